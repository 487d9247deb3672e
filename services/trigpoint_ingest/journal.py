"""The way into the log: what was admitted is gathered by stream until it is committed."""

import logging
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from trigpoint.bus.ports import Bus
from trigpoint.errors import EventRejected, FrameRefused
from trigpoint.events.codec import Event
from trigpoint.events.envelope import EncodedMessage, Envelope, EventIdentity
from trigpoint.events.keys import STREAM_PATTERNS, stream_of
from trigpoint.events.observed import EventRefused, MapFramePinned, VehicleDescribed
from trigpoint.events.runs import EncodedRun
from trigpoint.logs.ports import RecallingLog
from trigpoint.logs.readings import pinned_frame
from trigpoint.observability.metrics import Instruments
from trigpoint_ingest.commit import Group, GroupCommit, Row
from trigpoint_ingest.core.framing import frame_pinned_by
from trigpoint_ingest.core.messages import messages_of
from trigpoint_ingest.core.plain_payloads import FIX_SCHEMA, PlainPayloads
from trigpoint_ingest.core.refusal import refusal_of, refused_identity
from trigpoint_ingest.core.tally import Tally
from trigpoint_ingest.recall import admission_from
from trigpoint_ingest.settings import IngestSettings

MAP_STREAM = STREAM_PATTERNS[MapFramePinned]
REFUSED_STREAM = STREAM_PATTERNS[EventRefused]
VEHICLE_STREAM = STREAM_PATTERNS[VehicleDescribed]
FRAME_IDENTITY = EventIdentity("ingest", "map-frame", 0)
SHORT_STRETCH = 16  # messages that are sooner looked at one by one than together
LARGE_BYTES = 16 * 1024  # of payload that is not

logger = logging.getLogger(__name__)


class Journal:
    """Everything one ingest knows and has not yet written; the only writer of its streams."""

    def __init__(
        self, log: RecallingLog, bus: Bus | None, settings: IngestSettings, *, instruments: Instruments | None = None
    ) -> None:
        self._settings = settings
        self._instruments = instruments if instruments is not None else Instruments("ingest")
        self._commit = GroupCommit(log, bus, settings, self._instruments)
        self._pending: dict[str, list[Row]] = {}
        self._unfinished: Group | None = None
        self._stream_of_source: dict[str, str] = {}
        self._plain = PlainPayloads()
        self.pending_count = 0
        self.pending_bytes = 0
        self.admission = admission_from(log, settings)
        self.tally = Tally()
        self._refused_number = log.next_number(REFUSED_STREAM)
        self._frame_pinned = pinned_frame(log) is not None

    def take(self, message: EncodedMessage) -> None:
        """The message admitted, counted as a duplicate, or refused and kept with its reason."""
        vehicle = message.identity.source
        try:
            envelope = self.admission.admit(message)
        except EventRejected as error:
            self.refuse(message, error)
            return
        if envelope is None:
            self.count_duplicates(vehicle, 1)
            return
        self._count_accepted(vehicle, 1)
        stream = self._stream_of_source.get(vehicle)
        if stream is None:
            stream = self._stream_of_source[vehicle] = stream_of(envelope)
        self._add(stream, envelope, len(message.payload))
        if not self._frame_pinned:
            self.pin_frame(envelope.event, stamp_ns=envelope.stamp_ns)

    def take_run(self, run: EncodedRun) -> None:
        """Each message as by `take`, those of a drive in ascending order; most of them together."""
        for stretch, is_plain in _stretches(run, self._plain_rows(run)):
            if is_plain and self.admission.admit_run(stretch):
                self._count_accepted(run.source, len(stretch))
                self._add(VEHICLE_STREAM.format(vehicle=run.source), stretch, sum(map(len, stretch.payloads)))
            elif self.admission.has_all(stretch):
                self.count_duplicates(run.source, len(stretch))
            else:
                for message in messages_of(stretch):
                    self.take(message)

    def _plain_rows(self, run: EncodedRun) -> NDArray[np.bool_]:
        """Which messages (n,) can be taken together; of fixes none before the map has a frame, for any may pin it."""
        plain = np.zeros(len(run), dtype=np.bool_)
        for number, schema in enumerate(run.schemas):
            if schema != FIX_SCHEMA or self._frame_pinned:
                rows = np.flatnonzero(run.schema_of_row == number)
                plain[rows] = self._plain.plain(schema, [run.payloads[row] for row in rows.tolist()])
        return plain

    def pin_frame(self, event: object, *, stamp_ns: int) -> None:
        """The map's frame pinned by this event, if it was not yet and the event can."""
        try:
            pinned = None if self._frame_pinned else frame_pinned_by(event)
        except FrameRefused as error:
            logger.warning("no map frame from %s: %s", type(event).__name__, error)
            return
        if pinned is not None:
            self._frame_pinned = True
            self._add(MAP_STREAM, Envelope(FRAME_IDENTITY, stamp_ns, pinned), 0)

    def refuse(self, message: EncodedMessage, error: EventRejected) -> None:
        """The message counted by its reason, and kept if it was not refused before."""
        self.tally.refused[message.identity.source, error.reason] += 1
        self._instruments.rejected.labels(message.identity.source, error.reason).inc()
        limit = self._settings.refused_payload_limit
        refusal = refusal_of(message, error, payload_limit=limit, number=self._refused_number)
        if self.admission.refuse(refused_identity(refusal)):
            self._refused_number += 1
            self._add(REFUSED_STREAM, refusal, len(refusal.event.payload))

    def _count_accepted(self, vehicle: str, count: int) -> None:
        self.tally.accepted[vehicle] += count
        self._instruments.accepted.labels(vehicle).inc(count)

    def count_duplicates(self, vehicle: str, count: int) -> None:
        """So many messages more that were there already."""
        self.tally.duplicates[vehicle] += count
        self._instruments.duplicates.labels(vehicle).inc(count)

    def _add(self, stream: str, row: Envelope[Event] | EncodedRun, size_bytes: int) -> None:
        self._pending.setdefault(stream, []).append(row)
        self.pending_count += len(row) if isinstance(row, EncodedRun) else 1
        self.pending_bytes += size_bytes

    def sealed(self) -> Group:
        """Everything pending as a group, to be given to `commit`; from now on the next one is gathered."""
        group = Group(self._pending, [])
        self._pending, self.pending_count, self.pending_bytes = {}, 0, 0
        return group

    def commit(self, group: Group) -> None:
        """The group durable, published and acknowledged; may work in a thread of its own, one group at a time.

        Raises AppendFailed: the group may be committed again.
        """
        self._commit.commit(group)

    def flush(self) -> None:
        """Everything pending is durable, and published after that.

        Raises AppendFailed: what was not appended stays pending.
        """
        if self._unfinished is not None:
            self.commit(self._unfinished)
        self._unfinished = self.sealed()
        self.commit(self._unfinished)
        self._unfinished = None


def _stretches(run: EncodedRun, plain: NDArray[np.bool_]) -> list[tuple[EncodedRun, bool]]:
    """The run cut where plain messages and others meet; plain stretches that are short count as others."""
    if plain.all():
        return [(run, True)]
    edges = [0, *(np.flatnonzero(np.diff(plain)) + 1).tolist(), len(run)]
    cuts: list[tuple[int, int, bool]] = []
    for start, stop in pairwise(edges):
        is_plain = bool(plain[start]) and _is_worth_it(run, start, stop)
        if cuts and not is_plain and not cuts[-1][2]:
            cuts[-1] = (cuts[-1][0], stop, False)
        else:
            cuts.append((start, stop, is_plain))
    return [(run if stop - start == len(run) else run.part(start, stop), is_plain) for start, stop, is_plain in cuts]


def _is_worth_it(run: EncodedRun, start: int, stop: int) -> bool:
    """Whether plain messages [start, stop) are taken together: if there is nothing else, or enough of them."""
    count = stop - start
    return count == len(run) or count >= SHORT_STRETCH or sum(map(len, run.payloads[start:stop])) >= LARGE_BYTES
