"""One machine's processes kept running: started in order, started again when they end, stopped in reverse."""

import logging
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from trigpoint.configuration.sections import UpSettings
from trigpoint.observability.endpoint import Status
from trigpoint.observability.metrics import Instruments
from trigpoint_cli.supervision import Life, after_end, after_start, is_failing

LOOK_S = 0.1  # between two looks at the processes

Clock = Callable[[], float]

logger = logging.getLogger(__name__)


class Requests(Protocol):
    """Who may tell the supervisor to stop."""

    def wait(self, timeout_s: float) -> str | None:
        """Why to stop, or None if there was no reason within the timeout."""


class Supervised(Protocol):
    """A process that was started."""

    @property
    def pid(self) -> int:
        """Its process id."""

    def status(self) -> int | None:
        """Its exit status, or None while it runs."""

    def stop(self, limit_s: float) -> bool:
        """Whether it ended within the limit after being asked to; if not, it was killed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """How processes are started and asked here, by name."""

    start: Callable[[str], Supervised]
    is_ready: Callable[[str], bool]


class Supervisor:
    """Keeps the processes of `settings.services` running until there is a request to stop."""

    def __init__(
        self, settings: UpSettings, machine: Machine, instruments: Instruments, *, now_s: Clock = time.monotonic
    ) -> None:
        self._settings, self._machine, self._instruments, self._now_s = settings, machine, instruments, now_s
        self._lives: dict[str, Life] = {name: Life() for name in settings.services}
        self._children: dict[str, Supervised] = {}
        self._came_up: set[str] = set()
        self.killed: list[str] = []

    def run(self, requests: Requests) -> str:
        """Why it was told to stop; the processes have ended then."""
        try:
            while (reason := requests.wait(LOOK_S)) is None:
                self.look()
            logger.info("stopping", extra={"reason": reason, "running": list(self._children)})
            return reason
        finally:
            self._stop_all()

    def look(self) -> None:
        """Ends taken note of, and what is due started: the first time each only after those before it are ready."""
        for name in self._settings.services:
            self._note_end(name)
        for name in self._settings.services:
            life = self._lives[name]
            if not life.runs and self._now_s() >= life.due_s:
                self._start(name)
            if not self._is_up(name):
                return

    def _note_end(self, name: str) -> None:
        child = self._children.get(name)
        status = None if child is None else child.status()
        if status is None:
            return
        del self._children[name]
        life = self._lives[name] = after_end(self._lives[name], status, self._settings, now_s=self._now_s())
        log = logger.error if self._is_failing(name) else logger.warning
        wait_s = life.due_s - self._now_s()
        log("%s ended with status %d, %d times in a row", name, status, life.ends_in_row, extra={"again_in_s": wait_s})

    def _start(self, name: str) -> None:
        child = self._children[name] = self._machine.start(name)
        life = self._lives[name] = after_start(self._lives[name], now_s=self._now_s())
        if life.restarts:
            self._instruments.restarts.labels(name).inc()
        logger.info("%s started", name, extra={"pid": child.pid, "restarts": life.restarts})

    def _is_up(self, name: str) -> bool:
        """Whether those after it may start: it was ready once, or had its time to become so."""
        if name in self._came_up:
            return True
        life = self._lives[name]
        waited = life.started_s is not None and self._now_s() - life.started_s >= self._settings.start_limit_s
        if waited:
            logger.warning("%s is not ready after %g s; the next one starts", name, self._settings.start_limit_s)
        if waited or self._is_failing(name) or (life.runs and self._machine.is_ready(name)):
            self._came_up.add(name)
        return name in self._came_up

    def _is_failing(self, name: str) -> bool:
        return is_failing(self._lives[name], self._settings, now_s=self._now_s())

    def _stop_all(self) -> None:
        for name in reversed(self._settings.services):
            child = self._children.pop(name, None)
            if child is not None and not child.stop(self._settings.stop_limit_s):
                logger.error("%s had not ended after %g s and was killed", name, self._settings.stop_limit_s)
                self.killed.append(name)

    def alive(self) -> Status:
        """Alive unless a process keeps failing; tells of each."""
        failing = [name for name in self._settings.services if self._is_failing(name)]
        return not failing, {"failing": failing, "processes": {name: self._told(name) for name in self._lives}}

    def ready(self) -> Status:
        """Ready when every process runs and is ready."""
        waiting = [
            name for name in self._settings.services if not (self._lives[name].runs and self._machine.is_ready(name))
        ]
        return not waiting, {"waiting_for": waiting}

    def exposition(self) -> bytes:
        """Restarts, for Prometheus."""
        return self._instruments.exposition()

    def _told(self, name: str) -> Mapping[str, Any]:
        life, child = self._lives[name], self._children.get(name)
        return {
            "running": life.runs,
            "pid": None if child is None else child.pid,
            "restarts": life.restarts,
            "ends_in_row": life.ends_in_row,
            "last_status": life.last_status,
        }
