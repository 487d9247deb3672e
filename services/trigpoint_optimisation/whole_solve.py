"""The whole map solved beside the updates: in a process of its own, so that they keep their pace."""

import multiprocessing
import os
import threading
import time
from collections.abc import Generator, Iterable
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Protocol

from trigpoint.errors import InputError, ServiceError
from trigpoint.events.mapped import Mapped, MapSolved
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import logged_anchors, logged_drives, logged_frame, logged_verdicts
from trigpoint_optimisation.app import input_positions, last_seen_ns
from trigpoint_optimisation.core.solve import solve_map
from trigpoint_optimisation.settings import SolveSettings

ASKER_GONE = 1  # exit status
END = "end"  # what a solving process says last

Inputs = tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class WholeSolve:
    """A map solved from everything up to `inputs`: its head and its other events, of version UNNUMBERED, and the newest
    measurement among them; or why there is none. The events can be gone through once: with the years of a fleet they
    are more than a service should hold."""

    inputs: Inputs
    head: MapSolved | None = None
    parts: Iterable[Mapped] = ()
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
    stamp_ns = last_seen_ns(solution)
    return WholeSolve(inputs=inputs, head=head, parts=events[:-1], stamp_ns=stamp_ns, left_out=left_out)


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
        """What the process says, if it has begun to; its parts come from it one by one."""
        solving, answers = self._solving, self._answers
        if solving is None or answers is None or not answers.poll():
            return None
        self._solving = self._answers = None
        said = _said(solving, answers)
        found: WholeSolve = next(said)
        return replace(found, parts=said) if found.head is not None else replace(found, parts=tuple(said))

    def close(self) -> None:
        """The process under way, if any, ended."""
        if self._solving is not None and self._answers is not None:
            self._solving.kill()
            self._solving.join()
            self._answers.close()
            self._solving = self._answers = None


def _said(solving: multiprocessing.process.BaseProcess, answers: Connection) -> Generator[Any, None, None]:
    """What a process says, to its END; then it is gone. Raises ServiceError where it died before."""
    try:
        with answers:
            while (said := answers.recv()) != END:
                yield said
    except EOFError as error:
        solving.join()
        raise ServiceError(f"the solving process ended with status {solving.exitcode}") from error
    finally:
        solving.join()


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
        answers.send(replace(found, parts=()))
        for said in (*found.parts, END):
            answers.send(said)


def _end_with_whoever_asked() -> None:
    """This process ended once the one that began it is gone, killed perhaps: nobody waits for the solve then."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(ASKER_GONE)
