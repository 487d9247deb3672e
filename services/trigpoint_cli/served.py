"""One service at work in a thread of its own, and what is known of it from outside."""

import logging
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from enum import StrEnum
from typing import Any

from trigpoint.observability.endpoint import Status
from trigpoint.observability.masking import without_password
from trigpoint.observability.metrics import Instruments
from trigpoint.observability.running import Service, WatchedStop

Opened = Callable[[], AbstractContextManager[Service]]

logger = logging.getLogger(__name__)


class Stage(StrEnum):
    """Where in its life a service is."""

    STARTING = "starting"
    RUNNING = "running"
    STOPPING = "stopping"
    ENDED = "ended"
    FAILED = "failed"


class ServedService(threading.Thread):
    """A service opened, run and closed in one thread; `error` is what ended it, if it was not told to end.

    It is alive while its loop comes round at least every `silence_limit_s`.
    """

    def __init__(
        self,
        opened: Opened,
        instruments: Instruments,
        *,
        silence_limit_s: float,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(name=instruments.service, daemon=True)
        self._opened, self._instruments = opened, instruments
        self._silence_limit_s = silence_limit_s
        self._request = WatchedStop(now_s=now_s)
        self._told_to_stop = self._told_of_silence = False
        self._service: Service | None = None
        self._finished = threading.Event()
        self._began_s = time.monotonic()
        self.error: Exception | None = None

    def run(self) -> None:
        """The service's life; ends when it was told to, or cannot go on."""
        try:
            with self._opened() as service:
                self._request.is_set()  # its silence counts from now on
                self._service = service
                service.run(self._request)
                service.close()
        except Exception as error:  # raised again by whoever waits for this thread
            self.error = error
        finally:
            self._finished.set()

    @property
    def stage(self) -> Stage:
        """Where in its life the service is."""
        if self._finished.is_set():
            return Stage.ENDED if self.error is None else Stage.FAILED
        if self._told_to_stop:
            return Stage.STOPPING
        return Stage.STARTING if self._service is None else Stage.RUNNING

    def stop(self, limit_s: float) -> bool:
        """Whether it finished what it began, within the limit."""
        self._told_to_stop = True
        self._request.set()
        self.join(limit_s)
        return not self.is_alive()

    @property
    def hangs(self) -> bool:
        """Whether its loop has not come round for too long."""
        return self.stage is Stage.RUNNING and self._request.silent_s > self._silence_limit_s

    def look(self) -> None:
        """That the service hangs, or goes on after it did, is logged once."""
        if self.hangs == self._told_of_silence:
            return
        self._told_of_silence = not self._told_of_silence
        if self._told_of_silence:
            logger.error("the service hangs: %s", self._silence())
        else:
            logger.warning("the service, which hung, goes on")

    def _silence(self) -> str:
        return f"its loop last came round {self._request.silent_s:.0f} s ago, limit {self._silence_limit_s:g} s"

    def alive(self) -> Status:
        """Alive unless it failed or hangs."""
        return self.stage is not Stage.FAILED and not self.hangs, self._details()

    def ready(self) -> Status:
        """Ready when the service says so."""
        service = self._service
        caught_up = service is not None and self.stage is Stage.RUNNING and service.ready
        return caught_up, self._details()

    def exposition(self) -> bytes:
        """The service's numbers."""
        return self._instruments.exposition()

    def _details(self) -> Mapping[str, Any]:
        details = {"service": self._instruments.service, "stage": self.stage.value}
        if self.error is not None:
            details["error"] = without_password(str(self.error))
        elif self.hangs:
            details["error"] = self._silence()
        return {**details, "up_s": round(time.monotonic() - self._began_s, 1)}
