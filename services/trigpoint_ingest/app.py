"""Ingest at work: vehicles' live messages from the bus into the log, acknowledged once they are durable."""

import logging
import time
from collections.abc import Callable

from trigpoint.bus.listening import ListeningService
from trigpoint.bus.ports import Bus, BusMessage
from trigpoint.errors import InputError
from trigpoint.events.envelope import EventIdentity
from trigpoint.events.uplink import ACKNOWLEDGEMENT_SCHEMA, acknowledgement_key, uplink_expression
from trigpoint.logs.ports import EventLog
from trigpoint_ingest.core.ordering import SequenceOrder
from trigpoint_ingest.core.tally import IngestReport
from trigpoint_ingest.core.validation import Drive, drive_of
from trigpoint_ingest.journal import Journal
from trigpoint_ingest.settings import IngestSettings

IDLE_S = 0.005  # between two looks at an empty queue: waking for each message costs more than the message

logger = logging.getLogger(__name__)


class IngestService(ListeningService):
    """Hears every vehicle on the bus: order restored, validated, appended in groups, published, acknowledged.

    Close it (or leave its `with`): what was admitted is then in the log.
    """

    def __init__(
        self, log: EventLog, bus: Bus, settings: IngestSettings, *, now_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._bus = bus
        self._now_s = now_s
        self._settings = settings
        self._journal = Journal(log, bus, settings)
        self._orders: dict[Drive, SequenceOrder] = {}
        self._gap_since_s: dict[Drive, float] = {}
        self._to_acknowledge: set[Drive] = set()
        self._flushed_s = now_s()
        self._lost = 0
        super().__init__(bus.subscribe(uplink_expression(root=settings.root)), idle_s=IDLE_S)

    def step(self, timeout_s: float) -> bool:
        """One message taken, or none within the timeout (then False); what is due is flushed."""
        message = self._subscription.receive(timeout_s)
        if message is not None:
            self._take(message)
        waited_s = self._now_s() - self._flushed_s
        if self._journal.pending_count >= self._settings.batch_count or waited_s >= self._settings.batch_s:
            self.flush()
        return message is not None

    def _take(self, message: BusMessage) -> None:
        drive = drive_of(message.identity)
        order = self._orders.get(drive)
        if order is None:
            following = self._journal.admission.acknowledged(drive) + 1
            order = self._orders[drive] = SequenceOrder(next_sequence=following, capacity=self._settings.held_limit)
        awaited = order.awaited
        for next_in_order in order.offer(message):
            self._journal.take(next_in_order)
        if order.awaited > awaited:
            self._gap_since_s.pop(drive, None)
        if order.held:
            self._gap_since_s.setdefault(drive, self._now_s())
        self._to_acknowledge.add(drive)

    def flush(self) -> None:
        """Everything admitted is in the log, then published, then acknowledged to its vehicles."""
        self._give_up_old_gaps()
        self._journal.flush()
        for drive in sorted(self._to_acknowledge):
            self._acknowledge(drive)
        self._to_acknowledge.clear()
        self._flushed_s = self._now_s()
        self._warn_of_losses()

    def _warn_of_losses(self) -> None:
        lost = self._subscription.lost + sum(order.overflowed for order in self._orders.values())
        if lost > self._lost:
            logger.warning("%d messages lost to a full queue; vehicles send them again", lost)
            self._lost = lost

    def _give_up_old_gaps(self) -> None:
        now_s = self._now_s()
        for drive, since_s in list(self._gap_since_s.items()):
            if now_s - since_s >= self._settings.gap_timeout_s:
                released = self._orders[drive].give_up()
                logger.error(
                    "drive %s: messages missing for %.0f s, going on with %d", drive, now_s - since_s, len(released)
                )
                for message in released:
                    self._journal.take(message)
                del self._gap_since_s[drive]

    def _acknowledge(self, drive: Drive) -> None:
        vehicle, boot_id = drive
        try:
            key = acknowledgement_key(vehicle, root=self._settings.root)
        except InputError:
            return  # no vehicle can have this name: its messages are refused, and it hears nothing
        sequence = self._journal.admission.acknowledged(drive)
        self._bus.publish(
            BusMessage(
                key=key,
                schema_name=ACKNOWLEDGEMENT_SCHEMA,
                payload=b"",
                identity=EventIdentity(vehicle, boot_id, sequence),
                stamp_ns=0,
            )
        )

    def report(self) -> IngestReport:
        """What came of the messages so far."""
        return self._journal.tally.report()

    def close(self) -> None:
        """The subscription ended; what was admitted is in the log."""
        self._subscription.close()
        self.flush()
