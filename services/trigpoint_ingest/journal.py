"""The way into the log: what was admitted is appended in groups, and published only then."""

import logging
from collections.abc import Sequence

from trigpoint.bus.event_messages import event_message
from trigpoint.bus.ports import Bus
from trigpoint.errors import EventRejected, FrameRefused
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.keys import STREAM_PATTERNS, key_of, stream_of
from trigpoint.events.observed import EventRefused, MapFramePinned
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import pinned_frame, vehicle_streams
from trigpoint_ingest.core.admission import Admission
from trigpoint_ingest.core.framing import frame_pinned_by
from trigpoint_ingest.core.messages import RawMessage
from trigpoint_ingest.core.refusal import refusal_of, refused_identity
from trigpoint_ingest.core.tally import Tally
from trigpoint_ingest.settings import IngestSettings

MAP_STREAM = STREAM_PATTERNS[MapFramePinned]
REFUSED_STREAM = STREAM_PATTERNS[EventRefused]
FRAME_IDENTITY = EventIdentity("ingest", "map-frame", 0)

logger = logging.getLogger(__name__)


class Journal:
    """Everything one ingest knows and has not yet written; the only writer of its streams."""

    def __init__(self, log: EventLog, bus: Bus | None, settings: IngestSettings) -> None:
        self._log = log
        self._bus = bus
        self._settings = settings
        self._pending: dict[str, list[Envelope[Event]]] = {}
        self._stream_of_source: dict[str, str] = {}
        self.pending_count = 0
        self.admission = admission_from(log, settings)
        self.tally = Tally()
        self._refused_number = log.next_number(REFUSED_STREAM)
        self._frame_pinned = pinned_frame(log) is not None

    def take(self, message: RawMessage) -> None:
        """The message admitted, counted as a duplicate, or refused and kept with its reason."""
        vehicle = message.identity.source
        try:
            envelope = self.admission.admit(message)
        except EventRejected as error:
            self.refuse(message, error)
            return
        if envelope is None:
            self.tally.duplicates[vehicle] += 1
            return
        self.tally.accepted[vehicle] += 1
        stream = self._stream_of_source.get(vehicle)
        if stream is None:
            stream = self._stream_of_source[vehicle] = stream_of(envelope)
        self._add(stream, envelope)
        if not self._frame_pinned:
            self.pin_frame(envelope.event, stamp_ns=envelope.stamp_ns)

    def pin_frame(self, event: object, *, stamp_ns: int) -> None:
        """The map's frame pinned by this event, if it was not yet and the event can."""
        try:
            pinned = None if self._frame_pinned else frame_pinned_by(event)
        except FrameRefused as error:
            logger.warning("no map frame from %s: %s", type(event).__name__, error)
            return
        if pinned is not None:
            self._frame_pinned = True
            self._add(MAP_STREAM, Envelope(FRAME_IDENTITY, stamp_ns, pinned))

    def refuse(self, message: RawMessage, error: EventRejected) -> None:
        """The message counted by its reason, and kept if it was not refused before."""
        self.tally.refused[message.identity.source, error.reason] += 1
        limit = self._settings.refused_payload_limit
        refusal = refusal_of(message, error, payload_limit=limit, number=self._refused_number)
        if self.admission.refuse(refused_identity(refusal)):
            self._refused_number += 1
            self._add(REFUSED_STREAM, refusal)

    def _add(self, stream: str, envelope: Envelope[Event]) -> None:
        self._pending.setdefault(stream, []).append(envelope)
        self.pending_count += 1

    def flush(self) -> None:
        """Everything pending is durable, and published after that.

        Raises AppendFailed: what was not appended stays pending.
        """
        appended: list[list[Envelope[Event]]] = []
        for stream in sorted(self._pending):
            self._log.append(stream, self._pending[stream])
            appended.append(self._pending.pop(stream))
            self.pending_count -= len(appended[-1])
        if self._bus is not None:
            for rows in appended:
                self._publish(self._bus, rows)

    def _publish(self, bus: Bus, rows: Sequence[Envelope[Event]]) -> None:
        """The rows on their keys; where nobody listens to a key, nothing is sent: the log has it."""
        key_of_kind: dict[tuple[type, str], str] = {}
        heard: dict[str, bool] = {}
        for envelope in rows:
            kind = (type(envelope.event), envelope.identity.source)
            key = key_of_kind.get(kind)
            if key is None:
                key = key_of_kind[kind] = key_of(envelope, root=self._settings.root, map_name=self._settings.map_name)
                heard[key] = bus.has_listener(key)
            if heard[key]:
                bus.publish(event_message(envelope, key=key))


def admission_from(log: EventLog, settings: IngestSettings) -> Admission:
    """The memory of what the log holds: identities, descriptions and times of vehicles, and refusals."""
    admission = Admission(fleet=settings.fleet, limits=settings.stamps)
    for stream in vehicle_streams(log):
        for row in log.read(stream):
            admission.recall(row.envelope)  # type: ignore[arg-type]  # only observations are in this stream
    for row in log.read(REFUSED_STREAM):
        if isinstance(row.envelope.event, EventRefused):
            admission.refuse(refused_identity(row.envelope))  # type: ignore[arg-type]
    return admission
