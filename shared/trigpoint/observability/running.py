"""What a service is to whoever runs it."""

import threading
import time
from collections.abc import Callable
from typing import Protocol


class Service(Protocol):
    """Something that runs until it is told to stop."""

    @property
    def ready(self) -> bool:
        """Whether it has caught up and does its work; before that it is alive, but not ready."""

    def run(self, stop: threading.Event) -> None:
        """Works until `stop` is set; what was begun is then finished. Raises what it cannot go on after."""

    def close(self) -> None:
        """What was begun is finished, nothing is held open; again: no effect."""


class WatchedStop(threading.Event):
    """Tells a service to stop, and knows how long the service has not looked: who does not look for long hangs.

    For one service's own thread; anyone may ask for `silent_s`.
    """

    def __init__(self, *, now_s: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._now_s = now_s
        self._looked_s = now_s()

    def is_set(self) -> bool:
        """Whether the service is to stop: it looked now."""
        self._looked_s = self._now_s()
        return super().is_set()

    def wait(self, timeout: float | None = None) -> bool:
        """Whether the service is to stop, at once or within the timeout, during which it need not look."""
        self._looked_s = float("inf") if timeout is None else self._now_s() + timeout
        try:
            return super().wait(timeout)
        finally:
            self._looked_s = self._now_s()

    @property
    def silent_s(self) -> float:
        """How long ago the service looked last; 0 while it waits."""
        return max(0.0, self._now_s() - self._looked_s)
