"""What arrives for ingest: checked for its sender and amount, put in order, and handed on to the journal."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace

from trigpoint.bus.ports import Bus, BusMessage, BusRun, Subscription
from trigpoint.errors import EventRejected, InputError
from trigpoint.events.envelope import EventIdentity
from trigpoint.events.runs import EncodedRun
from trigpoint.events.uplink import (
    ACKNOWLEDGEMENT_SCHEMA,
    acknowledgement_key,
    sender_of,
    uplink_expression,
    vehicle_expression,
)
from trigpoint.observability.metrics import Instruments
from trigpoint_ingest.core.messages import messages_of
from trigpoint_ingest.core.ordering import RunOrder
from trigpoint_ingest.core.rates import MessageAllowance
from trigpoint_ingest.core.validation import Drive
from trigpoint_ingest.journal import Journal
from trigpoint_ingest.settings import IngestSettings

TAKEN_AT_ONCE, TAKEN_AT_ONCE_BYTES = 256, 1024 * 1024  # before it is looked at what is due
CUT_OFF_S = 10.0  # a vehicle with something missing that is silent for so long has no link, and sends it again later
HANDED_ON_COUNT, HANDED_ON_BYTES = 2048, 1024 * 1024  # taken, which are handed on before a group is due
WRONG_SENDER = "wrong sender"
TOO_LARGE = "too large"
TOO_MANY_DRIVES, TOO_MANY_MESSAGES, TOO_MANY_NAMES = "too many drives", "too many messages", "too many names"
NOBODY = EventIdentity("", "", -1)

logger = logging.getLogger(__name__)


class Reception:
    """Takes what the subscriptions have, and knows which drives wait for an acknowledgement."""

    def __init__(
        self,
        bus: Bus,
        journal: Journal,
        settings: IngestSettings,
        instruments: Instruments,
        *,
        now_s: Callable[[], float],
    ) -> None:
        self._journal, self._settings, self._instruments = journal, settings, instruments
        self._now_s = now_s
        self._arrived: dict[Drive, list[EncodedRun]] = {}
        self._arrived_count = self._arrived_bytes = 0
        self._orders: dict[Drive, RunOrder] = {}
        self._gap_since_s: dict[Drive, float] = {}
        self._gap_heard_s: dict[Drive, float] = {}  # when a drive with a gap was last heard
        self._allowances: dict[str, MessageAllowance] = {}
        self._to_acknowledge: set[Drive] = set()
        self._told: set[tuple[str, str]] = set()
        self._lost = 0
        self._subscriptions: list[Subscription] = [bus.subscribe(one) for one in _expressions(settings)]

    @property
    def waiting(self) -> int:
        """How many messages came and were not taken yet."""
        return sum(subscription.waiting for subscription in self._subscriptions)

    @property
    def waiting_bytes(self) -> int:
        """How large they are."""
        return sum(subscription.waiting_bytes for subscription in self._subscriptions)

    @property
    def arrived(self) -> int:
        """How many messages were taken and not handed on."""
        return self._arrived_count

    @property
    def has_to_acknowledge(self) -> bool:
        """Whether a vehicle sent something since the last acknowledgements."""
        return bool(self._to_acknowledge) or self._arrived_count > 0

    def take(self, timeout_s: float) -> int:
        """How many messages came: all there are now, TAKEN_AT_ONCE or a few more at most; the first of each
        subscription may take until the timeout to come. They are handed on together: for a few at a time the columns
        cost more than they save."""
        taken = taken_bytes = 0
        for subscription in self._subscriptions:
            found = subscription.receive_run(timeout_s)
            while found is not None:
                self._take(found)
                taken += len(found.run)
                taken_bytes += sum(map(len, found.run.payloads))
                has_room = taken < TAKEN_AT_ONCE and taken_bytes < TAKEN_AT_ONCE_BYTES
                found = subscription.receive_run(0.0) if has_room else None
        self._arrived_bytes += taken_bytes
        if self._arrived_count >= HANDED_ON_COUNT or self._arrived_bytes >= HANDED_ON_BYTES:
            self.hand_on()
        return taken

    def hand_on(self) -> None:
        """What was taken put in order, and given to the journal as far as it may go on."""
        arrived, self._arrived = self._arrived, {}
        self._arrived_count = self._arrived_bytes = 0
        for drive, runs in arrived.items():
            self._order(drive, runs)

    def _take(self, found: BusRun) -> None:
        """The run kept for its drive, as much of it as its sender may send."""
        sender = sender_of(found.key)
        run = self._within_allowance(sender, found.run)
        drive = (run.source, run.boot_id)
        if not len(run):
            return
        if run.source and run.source != sender:
            self._refuse_impostor(sender, run)
        elif not run.source or int(run.sequences.min()) < 0:
            self._take_aside(run)
        elif self._journal.admission.has_room_for(drive):
            self._arrived.setdefault(drive, []).append(run)
            self._arrived_count += len(run)
        else:
            self._tell_once(sender, TOO_MANY_DRIVES, f"limit {self._settings.drive_limit}: not taken, not acknowledged")
            self._instruments.rejected.labels(sender, TOO_MANY_DRIVES).inc(len(run))

    def _within_allowance(self, sender: str, run: EncodedRun) -> EncodedRun:
        """What of a run its sender may send now; the rest is counted and, unacknowledged, comes again."""
        now_s, settings = self._now_s(), self._settings
        allowance = self._allowances.get(sender)
        if allowance is None and len(self._allowances) >= settings.name_limit:
            self._tell_once("", TOO_MANY_NAMES, f"limit {settings.name_limit}: {sender!r} is not heard")
            self._instruments.throttled.labels("").inc(len(run))
            return run.part(0, 0)
        if allowance is None:
            allowance = self._allowances[sender] = MessageAllowance(
                rate_hz=settings.vehicle_rate_hz, burst=settings.vehicle_burst, now_s=now_s
            )
        granted = allowance.take(len(run), now_s=now_s)
        if granted == len(run):
            return run
        self._tell_once(sender, TOO_MANY_MESSAGES, f"limit {settings.vehicle_rate_hz:g} Hz: the rest has to come again")
        self._instruments.throttled.labels(sender).inc(len(run) - granted)
        return run.part(0, granted)

    def _take_aside(self, run: EncodedRun) -> None:
        """Messages that name no event of anyone: refused, each by itself."""
        for message in messages_of(run):
            self._journal.take(message)

    def _refuse_impostor(self, sender: str, run: EncodedRun) -> None:
        """Messages in another's name: refused as nobody's, so that nothing of the other's counts as refused."""
        self._tell_once(sender, WRONG_SENDER, f"it sends as {run.source!r}")
        self._instruments.refused_access.inc(len(run))
        for message in messages_of(run):
            nobodys = replace(message, identity=NOBODY)
            detail = f"sent on the key of {sender!r} as {message.identity.source!r}"
            self._journal.refuse(nobodys, EventRejected(WRONG_SENDER, detail))

    def _order(self, drive: Drive, runs: Sequence[EncodedRun]) -> None:
        """The drive's messages handed on as far as none before them is missing."""
        order = self._orders.get(drive)
        if order is None:
            following = self._journal.admission.acknowledged(drive) + 1
            order = self._orders[drive] = RunOrder(next_sequence=following, capacity=self._settings.held_limit)
        awaited, overflowed = order.awaited, order.overflowed
        released = order.offer(runs)
        for run in (released.again, released.following):
            if run is not None:
                self._hand_on(run)
        if released.doubled:
            self._journal.count_duplicates(drive[0], released.doubled)
        if order.overflowed > overflowed:
            self._count_lost(order.overflowed - overflowed)
        if order.awaited > awaited or not order.held:
            self._gap_since_s.pop(drive, None)
            self._gap_heard_s.pop(drive, None)
        if order.held:
            self._note_gap(drive, self._now_s())
        self._to_acknowledge.add(drive)

    def _note_gap(self, drive: Drive, now_s: float) -> None:
        """The wait for what is missing goes on, or begins: also after a vehicle was cut off, as it can send it now."""
        if drive not in self._gap_since_s:
            self._instruments.sequence_gaps.labels(drive[0]).inc()
        if drive not in self._gap_since_s or now_s - self._gap_heard_s[drive] > CUT_OFF_S:
            self._gap_since_s[drive] = now_s
        self._gap_heard_s[drive] = now_s

    def _hand_on(self, run: EncodedRun) -> None:
        limit = self._settings.message_limit_bytes
        if max(map(len, run.payloads)) <= limit:
            self._journal.take_run(run)
            return
        for message in messages_of(run):
            if len(message.payload) > limit:
                detail = f"payload of {len(message.payload)} bytes, limit {limit}"
                self._journal.refuse(message, EventRejected(TOO_LARGE, detail))
            else:
                self._journal.take(message)

    def settle(self) -> None:
        """Gaps that are too old given up; what was lost is told of."""
        now_s = self._now_s()
        for drive, since_s in list(self._gap_since_s.items()):
            is_cut_off = now_s - self._gap_heard_s[drive] > CUT_OFF_S
            if now_s - since_s >= self._settings.gap_timeout_s and not is_cut_off:
                released = self._orders[drive].give_up()
                count = 0 if released is None else len(released)
                logger.error("drive %s: messages missing for %.0f s, going on with %d", drive, now_s - since_s, count)
                if released is not None:
                    self._hand_on(released)
                del self._gap_since_s[drive], self._gap_heard_s[drive]
        lost = sum(subscription.lost for subscription in self._subscriptions)
        if lost > self._lost:
            self._count_lost(lost - self._lost)
            self._lost = lost

    def _count_lost(self, count: int) -> None:
        self._instruments.bus_lost.inc(count)
        logger.warning("%d messages lost to a full queue; vehicles send them again", count)

    def _tell_once(self, sender: str, reason: str, detail: str) -> None:
        """Logged the first time; later ones are only counted."""
        if (sender, reason) not in self._told:
            self._told.add((sender, reason))
            logger.warning("vehicle %r: %s: %s", sender, reason, detail)

    def acknowledgements(self) -> list[BusMessage]:
        """What the vehicles heard since the last time are to be told once all that was handed on is durable."""
        drives, self._to_acknowledge = sorted(self._to_acknowledge), set()
        found = (self._acknowledgement(drive) for drive in drives)
        return [message for message in found if message is not None]

    def _acknowledgement(self, drive: Drive) -> BusMessage | None:
        vehicle, boot_id = drive
        try:
            key = acknowledgement_key(vehicle, root=self._settings.root)
        except InputError:
            return None  # no vehicle can have this name: its messages are refused, and it hears nothing
        sequence = self._journal.admission.acknowledged(drive)
        identity = EventIdentity(vehicle, boot_id, sequence)
        return BusMessage(key=key, schema_name=ACKNOWLEDGEMENT_SCHEMA, payload=b"", identity=identity, stamp_ns=0)

    def close(self) -> None:
        """Nothing more is taken."""
        for subscription in self._subscriptions:
            subscription.close()


def _expressions(settings: IngestSettings) -> list[str]:
    if not settings.vehicles:
        return [uplink_expression(root=settings.root)]
    return [vehicle_expression(vehicle, root=settings.root) for vehicle in settings.vehicles]
