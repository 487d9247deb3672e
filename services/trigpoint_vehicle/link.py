"""The bus a publisher sends on: its owner's, or a session of its own, opened anew when it does not do its work."""

import logging
import time
from collections.abc import Callable

from trigpoint.bus.ports import Bus
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings
from trigpoint.errors import ServiceError

RETRY_S = 1.0  # after the first attempt to open a session that failed
PAUSE_LONGEST_S = 60.0  # between two new sessions, however long nothing is acknowledged

logger = logging.getLogger(__name__)


class Link:
    """A bus that may be away for a while. For one thread."""

    def __init__(
        self, bus: Bus | ZenohSettings, *, reopen_after_s: float, now_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._lent = None if isinstance(bus, ZenohSettings) else bus
        self._settings = bus if isinstance(bus, ZenohSettings) else None
        self._own: Bus | None = None
        self._first_s = self._pause_s = reopen_after_s
        self._retry_s = RETRY_S
        self._now_s = now_s
        self._due_s = now_s()
        self.sessions = 0

    def opened(self) -> Bus | None:
        """A bus to begin anew with, or None if it is too early or there is none: the pauses grow from time to time."""
        now_s = self._now_s()
        if now_s < self._due_s:
            return None
        if self.sessions:
            self._pause_s = min(2.0 * self._pause_s, PAUSE_LONGEST_S)
        bus = self._lent if self._settings is None else self._new(self._settings)
        if bus is None:
            self._due_s = now_s + self._retry_s
            self._retry_s = min(2.0 * self._retry_s, PAUSE_LONGEST_S)
            return None
        self._due_s = now_s + self._pause_s
        self._retry_s = RETRY_S
        self.sessions += 1
        return bus

    def _new(self, settings: ZenohSettings) -> Bus | None:
        self.close()
        try:
            self._own = ZenohBus(settings)
        except ServiceError as error:
            logger.warning("%s; tried again in %.0f s", error, self._retry_s)
        return self._own

    def worked(self) -> None:
        """Something was acknowledged: the next session may come soon again."""
        self._pause_s = self._first_s

    def is_worn(self, silent_s: float) -> bool:
        """Whether a session of its own was silent for so long that a new one should be tried."""
        return self._settings is not None and silent_s > self._pause_s and self._now_s() >= self._due_s

    def close(self) -> None:
        """A session of its own is closed; an owner's bus is left as it is."""
        if self._own is not None:
            self._own.close()
            self._own = None
