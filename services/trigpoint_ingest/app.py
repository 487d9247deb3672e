"""Ingest at work: vehicles' live messages from the bus into the log, acknowledged once they are durable."""

import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from types import TracebackType
from typing import Self

from trigpoint.bus.ports import Bus
from trigpoint.errors import AppendFailed
from trigpoint.logs.ports import RecallingLog
from trigpoint.observability.metrics import Instruments
from trigpoint_ingest.claims import VehicleClaims
from trigpoint_ingest.commit import Group, waits_for_disk
from trigpoint_ingest.core.tally import IngestReport
from trigpoint_ingest.journal import Journal
from trigpoint_ingest.reception import Reception
from trigpoint_ingest.settings import IngestSettings

IDLE_S = 0.002  # between two looks at an empty queue: waiting for each message costs more than the message
QUIET_S = 0.01  # nothing came for so long: what is there needs not wait for more
ALONE_S, ALONE_COUNT = 0.02, 4096  # a group under way has the interpreter to itself so long, if no more messages wait
LARGE_BYTES = 1024 * 1024  # to be taken at once, however few messages they are
CLAIM_LOOK_S = 1.0  # between two looks at others' claims

logger = logging.getLogger(__name__)


class IngestService:
    """Hears its vehicles on the bus: order restored, validated, appended in groups, published, acknowledged.

    While a group is made durable the next one is gathered, if there is much to gather. Close it (or leave its `with`):
    what was admitted is then in the log.
    """

    def __init__(
        self,
        log: RecallingLog,
        bus: Bus,
        settings: IngestSettings,
        *,
        instruments: Instruments | None = None,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        """Raises ServiceError if another ingest has claimed one of the vehicles, LogDamaged for a damaged log."""
        self._settings, self._now_s = settings, now_s
        self._instruments = instruments if instruments is not None else Instruments("ingest")
        self._claims = VehicleClaims(bus, settings.vehicles, root=settings.root)
        try:
            self._claims.require()
            self._journal = Journal(log, bus, settings, instruments=self._instruments)
            self._reception = Reception(bus, self._journal, settings, self._instruments, now_s=now_s)
        except BaseException:
            self._claims.release()
            raise
        self._committer = ThreadPoolExecutor(1, thread_name_prefix="commit")
        self._group: Group | None = None
        self._committing: Future[None] | None = None
        self._begun_s = self._sealed_s = self._heard_s = self._claims_seen_s = now_s()
        self._come = 0  # messages there at the last look
        self._blocked = False
        self._closed = False
        self.ready = False

    def run(self, stop: threading.Event) -> None:
        """Works until told to stop.

        Raises AppendFailed when the log cannot be written and waiting would not help, ServiceError when another
        ingest turns out to hold an earlier claim on a vehicle: then it must stop.
        """
        stop.wait(self._settings.claim_settle_s)  # word of others' claims comes by then
        self._claims.require()
        self.ready = True
        try:
            while not stop.is_set():
                if self._may_rest() or not self.step(0.0):
                    stop.wait(IDLE_S)
                self._look_at_claims()
        finally:
            self.ready = False

    def _may_rest(self) -> bool:
        """Whether all that has come can wait: what is taken together costs less."""
        now_s, come = self._now_s(), self._reception.waiting + self._gathered
        if come != self._come:
            self._come, self._heard_s = come, now_s
        if self._reception.waiting_bytes + self._journal.pending_bytes >= LARGE_BYTES:
            return False
        if self._group is None:
            return come < self._settings.live_batch_count and not self._waited_enough(now_s)
        is_slow = now_s - self._begun_s > self._settings.slow_append_s
        return self._committing is not None and not self._committing.done() and come <= ALONE_COUNT and not is_slow

    @property
    def _gathered(self) -> int:
        return self._reception.arrived + self._journal.pending_count

    def _waited_enough(self, now_s: float) -> bool:
        """Whether a group goes on, however small."""
        return now_s - self._sealed_s >= self._settings.batch_s or now_s - self._heard_s >= QUIET_S

    def step(self, timeout_s: float) -> bool:
        """What has come is taken, at most a group of it; False if nothing came within the timeout. What is due is
        committed. Raises AppendFailed."""
        has_room = (
            self._journal.pending_count < self._settings.pending_count
            and self._journal.pending_bytes < self._settings.pending_bytes
        )
        taken = self._reception.take(timeout_s) if has_room else 0
        if taken:
            self._heard_s = self._now_s()
        self._reception.settle()
        self._advance()
        self._instruments.queue_depth.set(self._reception.waiting + self._gathered)
        return taken > 0

    def _advance(self) -> None:
        """The group under way looked after; without one, the next begun when it is due."""
        now_s = self._now_s()
        if self._committing is not None and self._committing.done():
            self._finish()
        if self._committing is not None:
            if now_s - self._begun_s > self._settings.slow_append_s:
                self._tell_blocked(f"a group takes longer than {self._settings.slow_append_s:g} s")
        elif self._group is not None:
            if now_s - self._begun_s >= self._settings.disk_retry_s:
                self._begin(self._group)
        elif self._is_due(now_s):
            self._begin(self._sealed())

    def _is_due(self, now_s: float) -> bool:
        if self._gathered >= ALONE_COUNT or self._journal.pending_bytes >= self._settings.batch_bytes:
            return True
        # The vehicles that wait longest go on alone: a small group is soon durable, and then it is the others' turn.
        if self._gathered >= max(self._settings.live_batch_count, self._reception.waiting // 2):
            return True
        return self._waited_enough(now_s) and self._has_work()

    def _has_work(self) -> bool:
        return self._journal.pending_count > 0 or self._reception.has_to_acknowledge

    def _sealed(self) -> Group:
        self._reception.hand_on()
        group = self._journal.sealed()
        group.acknowledgements.extend(self._reception.acknowledgements())
        self._sealed_s = self._now_s()
        return group

    def _begin(self, group: Group) -> None:
        self._group, self._begun_s = group, self._now_s()
        self._committing = self._committer.submit(self._journal.commit, group)
        if self._reception.waiting <= ALONE_COUNT:  # two threads that take turns at every write need longer for both
            wait((self._committing,), timeout=ALONE_S)

    def _finish(self) -> None:
        """The end of the group under way. Raises what ended it, unless it is to be tried again."""
        ended, self._committing = self._committing, None
        error = ended.exception() if ended is not None else None
        if error is None:
            self._group = None
            if self._blocked:
                logger.warning("the log takes events again: going on")
            self._set_blocked(blocked=False)
        elif isinstance(error, AppendFailed) and waits_for_disk(error):
            self._tell_blocked(str(error))
        else:
            raise error

    def _tell_blocked(self, reason: str) -> None:
        if not self._blocked:
            logger.warning("nothing is acknowledged until the log can be written, vehicles keep theirs: %s", reason)
        self._set_blocked(blocked=True)

    def _set_blocked(self, *, blocked: bool) -> None:
        self._blocked = blocked
        self._instruments.append_blocked.set(int(blocked))

    def _look_at_claims(self) -> None:
        if self._now_s() - self._claims_seen_s >= CLAIM_LOOK_S:
            self._claims.require()
            self._claims_seen_s = self._now_s()

    def flush(self) -> None:
        """Everything admitted is in the log, then published, then acknowledged to its vehicles. Raises AppendFailed."""
        self._reception.settle()
        if self._committing is not None:
            self._committing.exception()  # waits; what it says is said again by the next attempt
            self._finish()
        if self._group is not None:
            self._journal.commit(self._group)
            self._group = None
        if self._has_work():
            self._group = self._sealed()
            self._journal.commit(self._group)
            self._group = None
        self._set_blocked(blocked=False)

    def report(self) -> IngestReport:
        """What came of the messages so far."""
        return self._journal.tally.report()

    def close(self) -> None:
        """The subscriptions ended, what was admitted is in the log, the vehicles free for others; again: no effect.

        Raises AppendFailed: what is not in the log was not acknowledged.
        """
        if self._closed:
            return
        self._reception.close()
        try:
            self.flush()
        finally:
            self._let_go()

    def _let_go(self) -> None:
        self._closed = True
        self._committer.shutdown()
        self._claims.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        else:
            self._reception.close()
            self._let_go()
