"""A spool's messages in the order they were spooled, read from its files as they become durable."""

import logging
from collections.abc import Callable, Generator, Iterator
from io import FileIO

from trigpoint.errors import InputError
from trigpoint.events.codec import event_class
from trigpoint.events.uplink import DROPPED_SCHEMA, uplink_key
from trigpoint_vehicle.core.outgoing import Outgoing, SendChannel
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
from trigpoint_vehicle.core.spool_walk import TOGETHER, Gap, walk
from trigpoint_vehicle.spool_segments import Segment

logger = logging.getLogger(__name__)


def send_channel(source: str, boot_id: str, schema_name: str, *, root: str) -> SendChannel:
    """Where a source's messages of a schema go, whether vehicles may send such or not: ingest says so.

    Raises InputError for a source that cannot be a vehicle's name.
    """
    try:
        key = uplink_key(source, event_class(schema_name), root=root)
    except InputError:
        key = uplink_key(source, None, root=root)
    return SendChannel(source, boot_id, schema_name, key)


class SpoolReader:
    """Reads on from segment to segment, over what is damaged; None stands for nothing more being there yet."""

    def __init__(self, following: Callable[[Segment | None], Segment | None], *, root: str) -> None:
        self._following = following
        self._root = root
        self._expected: dict[str, int] = {}  # the next sequence of each boot
        self.damaged_bytes = 0

    def messages(self) -> Generator[list[Outgoing] | None, None, None]:
        """Every message, some at a time, never ending. Raises OSError for a file that cannot be read."""
        segment: Segment | None = None
        while True:
            following = self._following(segment)
            if following is None:
                yield None
                continue
            segment = following
            yield from self._of_segment(segment)

    def _of_segment(self, segment: Segment) -> Iterator[list[Outgoing] | None]:
        channels: dict[int, tuple[SendChannel, bool]] = {}  # and whether its numbers leave no gaps
        for records in self._records(segment):
            if records is None:
                yield None
                continue
            messages: list[Outgoing] = []
            for record in records:
                if record.kind == MESSAGE and record.channel in channels:
                    channel, is_numbered = channels[record.channel]
                    expected = self._expected.get(channel.boot_id, record.sequence)
                    if record.sequence > expected and (is_numbered or self.damaged_bytes):
                        yield messages
                        yield from self._gone(channel, expected, record.sequence - 1, segment)
                        messages = []
                    self._expected[channel.boot_id] = max(record.sequence + 1, expected)
                    messages.append(_outgoing(channel, record, segment))
                elif record.kind == DROPPED and record.channel in channels:
                    channel, _ = channels[record.channel]
                    yield messages
                    yield from self._gone(channel, record.sequence, record.stamp_ns, segment)
                    messages = []
                    self._expected[channel.boot_id] = record.stamp_ns + 1
                else:
                    self._take_note(record, channels)
            yield messages

    def _take_note(self, record: Record, channels: dict[int, tuple[SendChannel, bool]]) -> None:
        if record.kind == SEGMENT and record.sequence >= 0:
            self._expected.setdefault(segment_of(record)[1], record.sequence)
        elif record.kind == CHANNEL:
            spooled = channel_of(record)
            channels[record.channel] = self._channel(spooled), spooled.numbered

    def _channel(self, spooled: SpoolChannel) -> SendChannel:
        return send_channel(spooled.source, spooled.boot_id, spooled.schema_name, root=self._root)

    def _gone(self, channel: SendChannel, first: int, last: int, segment: Segment) -> Iterator[list[Outgoing]]:
        key = uplink_key(channel.source, None, root=self._root)
        gone = SendChannel(channel.source, channel.boot_id, DROPPED_SCHEMA, key)
        for start in range(first, last + 1, TOGETHER):
            numbers = range(start, min(start + TOGETHER, last + 1))
            yield [Outgoing(gone, number, 0, b"", segment=segment.number, is_data=False) for number in numbers]

    def _records(self, segment: Segment) -> Iterator[list[Record] | None]:
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

    def _whole(self, segment: Segment, data: bytes, at: int) -> Iterator[list[Record]]:
        for part in walk(data):
            if isinstance(part, Gap):
                self.damaged_bytes += part.end - part.start
                logger.error("%s: bytes %d to %d are damaged", segment.path, at + part.start, at + part.end)
            else:
                yield part


def _outgoing(channel: SendChannel, record: Record, segment: Segment) -> Outgoing:
    return Outgoing(channel, record.sequence, record.stamp_ns, record.body, record.spooled_ns, segment.number)


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
