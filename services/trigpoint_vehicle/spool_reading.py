"""A spool's messages in the order they were spooled, read from its files as they become durable."""

import logging
from collections.abc import Callable, Iterator
from io import FileIO
from typing import NamedTuple

from trigpoint.bus.ports import BusMessage
from trigpoint.errors import InputError
from trigpoint.events.codec import event_class
from trigpoint.events.envelope import EventIdentity
from trigpoint.events.uplink import DROPPED_SCHEMA, uplink_key
from trigpoint_vehicle.core.spool_records import (
    CHANNEL,
    DROPPED,
    MESSAGE,
    SEGMENT,
    Record,
    SpoolChannel,
    channel_of,
    segment_of,
)
from trigpoint_vehicle.core.spool_walk import Gap, walk
from trigpoint_vehicle.spool_segments import Segment

logger = logging.getLogger(__name__)


class Spooled(NamedTuple):
    """A message read back; a tuple, as there are many. `is_data` is False for one that stands for a dropped one."""

    message: BusMessage
    spooled_ns: int
    segment: Segment
    is_data: bool


def sending_key(vehicle: str, schema_name: str, *, root: str) -> str:
    """The key a vehicle sends a schema's messages on, whether vehicles may send such or not: ingest says so."""
    try:
        return uplink_key(vehicle, event_class(schema_name), root=root)
    except InputError:
        return uplink_key(vehicle, None, root=root)


class SpoolReader:
    """Reads on from segment to segment, over what is damaged; None stands for nothing more being there yet."""

    def __init__(self, following: Callable[[Segment | None], Segment | None], *, root: str) -> None:
        self._following = following
        self._root = root
        self._expected: dict[str, int] = {}  # the next sequence of each boot
        self.damaged_bytes = 0

    def messages(self) -> Iterator[Spooled | None]:
        """Every message, never ending. Raises OSError for a file that cannot be read."""
        segment: Segment | None = None
        while True:
            following = self._following(segment)
            if following is None:
                yield None
                continue
            segment = following
            yield from self._of_segment(segment)

    def _of_segment(self, segment: Segment) -> Iterator[Spooled | None]:
        channels: dict[int, tuple[SpoolChannel, str]] = {}
        for record in self._records(segment):
            if record is None:
                yield None
            elif record.kind == SEGMENT:
                self._expected.setdefault(segment_of(record)[1], record.sequence)
            elif record.kind == CHANNEL:
                channel = channel_of(record)
                channels[record.channel] = channel, sending_key(channel.source, channel.schema_name, root=self._root)
            elif record.channel in channels:
                yield from self._sent(segment, record, *channels[record.channel])

    def _sent(self, segment: Segment, record: Record, channel: SpoolChannel, key: str) -> Iterator[Spooled]:
        sequence, boot_id = record.sequence, channel.boot_id
        expected = self._expected.get(boot_id, sequence)
        if sequence > expected and (channel.numbered or self.damaged_bytes):
            yield from self._gone(segment, channel, expected, sequence - 1)
        if record.kind == DROPPED:
            yield from self._gone(segment, channel, sequence, record.stamp_ns)
            sequence = record.stamp_ns
        elif record.kind == MESSAGE:
            identity = EventIdentity(channel.source, boot_id, sequence)
            message = BusMessage(
                key=key,
                schema_name=channel.schema_name,
                payload=record.body,
                identity=identity,
                stamp_ns=record.stamp_ns,
            )
            yield Spooled(message, record.spooled_ns, segment, True)
        self._expected[boot_id] = max(sequence + 1, expected)

    def _gone(self, segment: Segment, channel: SpoolChannel, first: int, last: int) -> Iterator[Spooled]:
        key = uplink_key(channel.source, None, root=self._root)
        for sequence in range(first, last + 1):
            identity = EventIdentity(channel.source, channel.boot_id, sequence)
            message = BusMessage(key=key, schema_name=DROPPED_SCHEMA, payload=b"", identity=identity, stamp_ns=0)
            yield Spooled(message, 0, segment, False)

    def _records(self, segment: Segment) -> Iterator[Record | None]:
        """The segment's whole records, as far as they are durable; ends when it is sealed and read."""
        at = 0
        with segment.path.open("rb", buffering=0) as file:  # nothing is read ahead of what is durable
            while True:
                is_sealed, durable = segment.sealed, segment.durable  # in this order: sealed is last to change
                if at < durable:
                    yield from self._whole(segment, _bytes_of(file, at, durable), at)
                    at = durable
                elif is_sealed and durable == segment.size:
                    return
                else:
                    yield None

    def _whole(self, segment: Segment, data: bytes, at: int) -> Iterator[Record]:
        for part in walk(data):
            if isinstance(part, Gap):
                self.damaged_bytes += part.end - part.start
                logger.error("%s: bytes %d to %d are damaged", segment.path, at + part.start, at + part.end)
            else:
                yield part


def _bytes_of(file: FileIO, start: int, end: int) -> bytes:
    """The file's bytes from `start` to `end`, or to where it ends now."""
    file.seek(start)
    parts: list[bytes] = []
    while start < end and (part := file.read(end - start)):
        parts.append(part)
        start += len(part)
    return b"".join(parts)


def require_vehicle(first: Record, vehicle: str, where: object) -> None:
    """Nothing, if a segment's first record is of this vehicle. Raises InputError naming both, LogDamaged."""
    found, _ = segment_of(first)
    if found != vehicle:
        raise InputError(f"{where}: the spool of vehicle {found!r}, not of {vehicle!r}")
