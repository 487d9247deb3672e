"""The fleet's Zenoh router as a process of its own."""

import logging
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager

from trigpoint.bus.refusals import Refusal, Told
from trigpoint.bus.router import ZenohRouter
from trigpoint.observability.metrics import Instruments
from trigpoint.observability.running import Service
from trigpoint_cli.settings import Settings

REPEAT_S = 60.0  # between two lines about the same refusal
REPEATS_LIMIT = 1024  # different refusals remembered

logger = logging.getLogger(__name__)


class RefusalLog:
    """Refusals counted; each kind of them is logged at once, and then at most every `REPEAT_S` with their number."""

    def __init__(self, instruments: Instruments) -> None:
        self._refused = instruments.refused_access
        self._said_s: dict[Refusal, float] = {}
        self._unsaid: dict[Refusal, int] = {}

    def hear(self, told: Told) -> None:
        """A refusal, or a remark of Zenoh's own, which is passed on."""
        if isinstance(told, Refusal):
            self._refused.inc()
            self._say(told)
        else:
            logger.log(logging.getLevelNamesMapping().get(told.level, logging.WARNING), "zenoh: %s", told.text)

    def _say(self, refusal: Refusal) -> None:
        now_s = time.monotonic()
        count = self._unsaid.pop(refusal, 0) + 1
        if now_s - self._said_s.get(refusal, -REPEAT_S) < REPEAT_S:
            self._unsaid[refusal] = count
            return
        if len(self._said_s) >= REPEATS_LIMIT:
            self._said_s.clear()
            self._unsaid.clear()
        self._said_s[refusal] = now_s
        details = {"who": refusal.who, "what": refusal.what, "key": refusal.key, "count": count}
        logger.warning("refused", extra=details)


@contextmanager
def opened(settings: Settings, instruments: Instruments) -> Iterator[Service]:
    """A router of the configuration. Raises InputError, and ServiceError where an endpoint cannot be had."""
    refusals = RefusalLog(instruments)
    with closing(ZenohRouter(settings.router, root=settings.fleet.root, tell=refusals.hear)) as router:
        yield router
