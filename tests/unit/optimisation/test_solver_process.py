"""A whole solve in a process of its own: what it says, and what becomes of it when it dies."""

import multiprocessing
from pathlib import Path

import pytest

from command_runs.processes import wait_until
from trigpoint.errors import ServiceError
from trigpoint.logs.mcap_log import McapLog
from trigpoint_optimisation.settings import SolveSettings
from trigpoint_optimisation.whole_solve import SolverProcess, WholeSolve


@pytest.fixture
def solver(tmp_path: Path) -> SolverProcess:
    """A solver of a log that pins no frame."""
    McapLog(tmp_path).close()
    return SolverProcess(tmp_path, SolveSettings())


def awaited(solver: SolverProcess) -> WholeSolve:
    found: list[WholeSolve] = []

    def is_there() -> bool:
        found.extend(one for one in [solver.result()] if one is not None)
        return bool(found)

    wait_until(is_there, "the solve", within_s=60.0)
    return found[0]


def test_what_cannot_be_solved_is_said_and_the_process_is_gone(solver: SolverProcess) -> None:
    solver.begin()
    found = awaited(solver)
    assert (found.head, list(found.parts)) == (None, [])
    assert "nothing was ingested yet" in found.refusal
    assert not solver.busy
    assert multiprocessing.active_children() == []


def test_a_process_that_died_is_an_error_that_names_its_status(solver: SolverProcess) -> None:
    solver.begin()
    (process,) = multiprocessing.active_children()
    process.kill()
    with pytest.raises(ServiceError, match="ended with status -9"):
        awaited(solver)
    assert not solver.busy


def test_a_solver_that_is_closed_leaves_no_process(solver: SolverProcess) -> None:
    solver.begin()
    solver.close()
    assert (solver.busy, multiprocessing.active_children()) == (False, [])
