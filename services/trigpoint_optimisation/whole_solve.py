"""The whole map solved beside the updates: in a process of its own, so that they keep their pace."""

import multiprocessing
import os
import threading
import time
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Protocol

from trigpoint.errors import InputError, ServiceError
from trigpoint.events.mapped import Mapped
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import logged_anchors, logged_drives, logged_frame, logged_verdicts
from trigpoint_optimisation.app import input_positions, last_seen_ns
from trigpoint_optimisation.core.solve import solve_map
from trigpoint_optimisation.settings import SolveSettings

ASKER_GONE = 1  # exit status

Inputs = tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class WholeSolve:
    """A map solved from everything up to `inputs`: its events of version UNNUMBERED, the head last, and the newest
    measurement among them; or why there is none."""

    inputs: Inputs
    events: tuple[Mapped, ...] = ()
    stamp_ns: int = 0
    left_out: tuple[str, ...] = ()
    refusal: str = ""


class WholeSolver(Protocol):
    """Solves the whole map, one solve at a time."""

    @property
    def busy(self) -> bool:
        """Whether a solve was begun whose result was not taken."""

    def begin(self) -> None:
        """A solve of the log as it stands begun."""

    def result(self) -> WholeSolve | None:
        """The solve, once it is there; None while it lasts. Raises ServiceError where its process died."""

    def close(self) -> None:
        """No more solves; one under way is given up."""


def whole_solve(log: EventLog, settings: SolveSettings) -> WholeSolve:
    """The log as it stands solved; what it does not allow is said as refusal."""
    inputs, begun_s = input_positions(log), time.monotonic()
    try:
        solution = solve_map(
            logged_drives(log), logged_anchors(log), logged_frame(log), settings, verdicts=logged_verdicts(log)
        )
        events = solution.map.events()
    except InputError as error:
        return WholeSolve(inputs=inputs, refusal=str(error))
    head = replace(solution.map.head, inputs=inputs, wall_s=time.monotonic() - begun_s)
    left_out = tuple(str(one) for one in solution.left_out)
    return WholeSolve(inputs=inputs, events=(*events[:-1], head), stamp_ns=last_seen_ns(solution), left_out=left_out)


class SolverInPlace:
    """A solver without a process: the solve is there when it is asked for."""

    def __init__(self, log: EventLog, settings: SolveSettings) -> None:
        self._log, self._settings = log, settings
        self.busy = False

    def begin(self) -> None:
        """Nothing is done before the result is asked for."""
        self.busy = True

    def result(self) -> WholeSolve | None:
        """The log solved now."""
        self.busy = False
        return whole_solve(self._log, self._settings)

    def close(self) -> None:
        """Nothing is under way."""


class SolverProcess:
    """A solver whose every solve is a process that reads the log itself, less urgent than this one."""

    def __init__(self, directory: Path, settings: SolveSettings) -> None:
        self._directory, self._settings = directory, settings
        self._context = multiprocessing.get_context("spawn")
        self._solving: multiprocessing.process.BaseProcess | None = None
        self._answers: Connection | None = None

    @property
    def busy(self) -> bool:
        """Whether a solve was begun whose result was not taken."""
        return self._solving is not None

    def begin(self) -> None:
        """A process begun."""
        ours, theirs = self._context.Pipe(duplex=False)
        arguments = (self._directory, self._settings, theirs)
        process = self._context.Process(target=_solve_for, args=arguments, name="whole-solve", daemon=True)
        process.start()
        theirs.close()
        self._solving, self._answers = process, ours

    def result(self) -> WholeSolve | None:
        """What the process said, if it has; then it is gone."""
        solving, answers = self._solving, self._answers
        if solving is None or answers is None or not answers.poll():
            return None
        try:
            found: WholeSolve = answers.recv()
        except EOFError as error:
            solving.join()
            raise ServiceError(f"the solving process ended with status {solving.exitcode}") from error
        finally:
            answers.close()
            self._solving = self._answers = None
        solving.join()
        return found

    def close(self) -> None:
        """The process under way, if any, ended."""
        if self._solving is not None and self._answers is not None:
            self._solving.kill()
            self._solving.join()
            self._answers.close()
            self._solving = self._answers = None


def _solve_for(directory: Path, settings: SolveSettings, answers: Connection) -> None:
    """The log in a directory solved, and said."""
    threading.Thread(target=_end_with_whoever_asked, name="end-with-parent", daemon=True).start()
    os.nice(settings.live.solver_niceness)
    log = McapLog(directory)
    try:
        found = whole_solve(log, settings)
    finally:
        log.close()
    with answers:
        answers.send(found)


def _end_with_whoever_asked() -> None:
    """This process ended once the one that began it is gone, killed perhaps: nobody waits for the solve then."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(ASKER_GONE)
