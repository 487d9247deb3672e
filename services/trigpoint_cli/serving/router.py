"""The fleet's Zenoh router as a process of its own."""

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field

from trigpoint.bus.refusals import Refusal, Told
from trigpoint.bus.router import ZenohRouter
from trigpoint.observability.metrics import Instruments
from trigpoint.observability.running import Service
from trigpoint_cli.settings import Settings

PERIOD_S = 60.0
KINDS_LIMIT = 20  # lines about one sender in a period: one that varies its keys fills no disk
SENDERS_LIMIT = 4096  # remembered

logger = logging.getLogger(__name__)


@dataclass(slots=True)
class _Said:
    """What was logged of one sender since `began_s`, and how many refusals of it were not."""

    began_s: float
    kinds: set[Refusal] = field(default_factory=set)
    unsaid: int = 0


class RefusalLog:
    """Refusals counted; of each sender the first of a kind is logged at once, `KINDS_LIMIT` kinds each `PERIOD_S`."""

    def __init__(self, instruments: Instruments, *, now_s: Callable[[], float] = time.monotonic) -> None:
        self._refused = instruments.refused_access
        self._now_s = now_s
        self._senders: dict[str, _Said] = {}

    def hear(self, told: Told) -> None:
        """A refusal, or a remark of Zenoh's own, which is passed on."""
        if isinstance(told, Refusal):
            self._refused.inc()
            self._say(told)
        else:
            logger.log(logging.getLevelNamesMapping().get(told.level, logging.WARNING), "zenoh: %s", told.text)

    def _say(self, refusal: Refusal) -> None:
        said = self._said_of(refusal.who)
        if refusal in said.kinds or len(said.kinds) >= KINDS_LIMIT:
            said.unsaid += 1
            return
        said.kinds.add(refusal)
        details = {"who": refusal.who, "what": refusal.what, "key": refusal.key, "unsaid": said.unsaid}
        said.unsaid = 0
        logger.warning("refused", extra=details)

    def _said_of(self, who: str) -> _Said:
        """What was logged of a sender in the present period."""
        now_s, before = self._now_s(), self._senders.get(who)
        if before is not None and now_s - before.began_s < PERIOD_S:
            return before
        if len(self._senders) >= SENDERS_LIMIT:
            self._senders.clear()
        fresh = self._senders[who] = _Said(now_s, unsaid=before.unsaid if before is not None else 0)
        return fresh


@contextmanager
def opened(settings: Settings, instruments: Instruments) -> Iterator[Service]:
    """A router of the configuration. Raises InputError."""
    refusals = RefusalLog(instruments)
    with closing(ZenohRouter(settings.router, root=settings.fleet.root, tell=refusals.hear)) as router:
        yield router
