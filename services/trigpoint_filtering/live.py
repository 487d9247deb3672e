"""Filtering at work on live messages: each drive followed as ingest publishes it, the log read where one is missing."""

import logging
from typing import cast

from trigpoint.bus.event_messages import event_message
from trigpoint.bus.listening import ListeningService
from trigpoint.bus.ports import Bus, BusMessage
from trigpoint.errors import EventRejected
from trigpoint.events.codec import Event, decode
from trigpoint.events.envelope import Envelope
from trigpoint.events.estimated import Estimated
from trigpoint.events.keys import DEFAULT_ROOT, KEY_VERSION, STREAM_PATTERNS, key_of
from trigpoint.events.observed import Observed, VehicleDescribed
from trigpoint.geodesy.projection import MapFrame
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import pinned_frame
from trigpoint_filtering.app import STREAM, said_of
from trigpoint_filtering.core.follower import DriveFollower
from trigpoint_filtering.settings import FilterSettings

IDLE_S = 0.05  # between two looks at an empty queue: what was estimated is appended at each
BATCH = 256  # estimates appended at a time
VEHICLE_STREAM = STREAM_PATTERNS[VehicleDescribed]

logger = logging.getLogger(__name__)


class LiveFiltering(ListeningService):
    """Hears what vehicles measured; appends its estimates, then publishes them. Close it, or leave its `with`."""

    def __init__(
        self, log: EventLog, bus: Bus, settings: FilterSettings | None = None, *, root: str = DEFAULT_ROOT
    ) -> None:
        self._log, self._bus, self._root = log, bus, root
        self._settings = settings or FilterSettings()
        self._frame: MapFrame | None = None
        self._said = {boot_id: said.count for boot_id, said in said_of(log).items()}
        self._followers: dict[tuple[str, str], DriveFollower] = {}
        self._expected: dict[tuple[str, str], int] = {}
        self._pending: list[Envelope[Estimated]] = []
        super().__init__(bus.subscribe(f"{root}/{KEY_VERSION}/veh/*/obs/**"), idle_s=IDLE_S)

    def step(self, timeout_s: float) -> bool:
        """One message taken, or none within the timeout (then False, and what was estimated is in the log)."""
        message = self._subscription.receive(timeout_s)
        if message is not None:
            self._take(message)
        if message is None or len(self._pending) >= BATCH:
            self.flush()
        return message is not None

    def _take(self, message: BusMessage) -> None:
        drive, sequence = (message.identity.source, message.identity.boot_id), message.identity.sequence
        self._frame = self._frame or pinned_frame(self._log)
        expected = self._expected.get(drive, 0)
        if self._frame is None or sequence < expected:
            return  # before the frame is pinned nothing can be placed: the log still has the message then
        try:
            event = cast(Observed, decode(message.schema_name, message.payload))
        except EventRejected as error:
            logger.warning("%s on %s is left to the log: %s", message.identity, message.key, error)
            return
        if sequence > expected:
            self.catch_up(drive, until_sequence=sequence)
        self._follow(Envelope(message.identity, message.stamp_ns, event), self._frame)

    def catch_up(self, drive: tuple[str, str], *, until_sequence: int | None = None) -> None:
        """The drive's events that are in the log and were not heard, taken, up to a sequence."""
        frame = self._frame = self._frame or pinned_frame(self._log)
        if frame is None:
            return
        missing = []
        for logged in self._log.read(VEHICLE_STREAM.format(vehicle=drive[0])):
            identity = logged.envelope.identity
            early = until_sequence is None or identity.sequence < until_sequence
            if identity.boot_id == drive[1] and early and identity.sequence >= self._expected.get(drive, 0):
                missing.append(cast(Envelope[Observed], logged.envelope))
        logger.info("drive %s of %s: %d events taken from the log", drive[1], drive[0], len(missing))
        for row in sorted(missing, key=lambda row: row.identity.sequence):
            self._follow(row, frame)

    def _follow(self, row: Envelope[Observed], frame: MapFrame) -> None:
        drive = (row.identity.source, row.identity.boot_id)
        self._expected[drive] = row.identity.sequence + 1
        follower = self._followers.get(drive)
        if follower is None:
            described = row.event if isinstance(row.event, VehicleDescribed) else VehicleDescribed(vehicle=drive[0])
            follower = self._followers[drive] = DriveFollower(described, drive[1], frame, self._settings)
        self._pending += self._unsaid(follower.take(row))

    def _unsaid(self, rows: list[Envelope[Estimated]]) -> list[Envelope[Estimated]]:
        return [row for row in rows if row.identity.sequence >= self._said.get(row.identity.boot_id, 0)]

    def flush(self) -> None:
        """What was estimated is in the log, then published."""
        if not self._pending:
            return
        rows = cast(list[Envelope[Event]], self._pending)
        self._log.append(STREAM, rows)
        self._pending = []
        for row in rows:
            self._bus.publish(event_message(row, key=key_of(row, root=self._root)))

    def close(self) -> None:
        """Every drive followed to the end of what the log has of it; the subscription ended."""
        self._subscription.close()
        for drive, follower in self._followers.items():
            self.catch_up(drive)
            self._pending += self._unsaid(follower.finish())
        self.flush()
