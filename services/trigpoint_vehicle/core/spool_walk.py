"""A segment's bytes record by record, over whatever is damaged in between; and the same with its data dropped."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from trigpoint.events.codec import schema_name
from trigpoint.events.observed import VehicleDescribed
from trigpoint_vehicle.core.spool_records import (
    CHANNEL,
    DROPPED,
    MESSAGE,
    SEALED,
    SEGMENT,
    Record,
    SpoolChannel,
    channel_of,
    channel_record,
    encode_record,
    next_whole_record,
    whole_records,
)

DESCRIPTION_SCHEMA = schema_name(VehicleDescribed)
TOGETHER = 256  # records at a time


@dataclass(frozen=True, slots=True)
class Gap:
    """Bytes that hold no whole record."""

    start: int
    end: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Contents:
    """What a segment holds; `whole_bytes` is where its last whole record ends."""

    messages: int
    payload_bytes: int
    whole_bytes: int
    gaps: tuple[Gap, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Dropped:
    """A segment without its sensor data: its bytes, and what went."""

    data: bytes
    messages: int
    payload_bytes: int


@dataclass(frozen=True, slots=True)
class _Range:
    """Messages of a boot, both ends included, that are not there any more."""

    channel: SpoolChannel
    first: int
    last: int


def walk(data: bytes) -> Iterator[list[Record] | Gap]:
    """The whole records in order, some at a time, and where there is none the bytes up to the next."""
    at = 0
    while at < len(data):
        records, end = whole_records(data, at, count=TOGETHER)
        if records:
            yield records
        else:
            end = next_whole_record(data, at)
            yield Gap(at, end)
        at = end


def contents_of(data: bytes) -> Contents:
    """How much a segment holds, and how much of it is whole."""
    gaps = tuple(part for part in walk(data) if isinstance(part, Gap))
    ends_damaged = bool(gaps) and gaps[-1].end == len(data)
    messages = [record for channel, record in _messages([data]) if record.kind == MESSAGE]
    return Contents(
        messages=len(messages),
        payload_bytes=sum(len(record.body) for record in messages),
        whole_bytes=gaps[-1].start if ends_damaged else len(data),
        gaps=gaps,
    )


def sealed_contents(size_bytes: int, tail: bytes) -> Contents | None:
    """What a segment of so many bytes says it holds, by its last ones (HEAD_BYTES); None if it was not closed in order.

    What is damaged inside of it is found when it is read.
    """
    records, _ = whole_records(tail, 0, count=1)
    if not records or records[0].kind != SEALED:
        return None
    return Contents(messages=records[0].sequence, payload_bytes=records[0].stamp_ns, whole_bytes=size_bytes, gaps=())


def without_data(segments: Sequence[bytes]) -> Dropped:
    """The segments as one, in which descriptions stay and everything else is only known to be gone."""
    kept: list[_Range | tuple[SpoolChannel, Record]] = []
    messages = payload_bytes = 0
    for channel, record in _messages(segments):
        if record.kind == MESSAGE and channel.schema_name == DESCRIPTION_SCHEMA:
            kept.append((channel, record))
            continue
        last = record.stamp_ns if record.kind == DROPPED else record.sequence
        _extend(kept, _Range(channel, record.sequence, last))
        messages += record.kind == MESSAGE
        payload_bytes += len(record.body)
    return Dropped(
        data=b"".join((_beginning(segments), *_encoded(kept))), messages=messages, payload_bytes=payload_bytes
    )


def _messages(segments: Sequence[bytes]) -> Iterator[tuple[SpoolChannel, Record]]:
    for data in segments:
        channels: dict[int, SpoolChannel] = {}
        for record in _records(data):
            if record.kind == CHANNEL:
                channels[record.channel] = channel_of(record)
            elif record.kind in (MESSAGE, DROPPED) and record.channel in channels:
                yield channels[record.channel], record


def _records(data: bytes) -> Iterator[Record]:
    for part in walk(data):
        if not isinstance(part, Gap):
            yield from part


def _extend(kept: list[_Range | tuple[SpoolChannel, Record]], gone: _Range) -> None:
    before = kept[-1] if kept else None
    if isinstance(before, _Range) and before.channel.boot_id == gone.channel.boot_id and before.last + 1 == gone.first:
        kept[-1] = replace(before, last=gone.last)
    else:
        kept.append(gone)


def _beginning(segments: Sequence[bytes]) -> bytes:
    for data in segments:
        records, end = whole_records(data, 0, count=1)
        if records and records[0].kind == SEGMENT:
            return data[:end]
    return b""


def _encoded(kept: Iterable[_Range | tuple[SpoolChannel, Record]]) -> Iterator[bytes]:
    numbers: dict[SpoolChannel, int] = {}
    for one in kept:
        channel = one.channel if isinstance(one, _Range) else one[0]
        if channel not in numbers:
            numbers[channel] = len(numbers)
            yield channel_record(numbers[channel], channel)
        if isinstance(one, _Range):
            yield encode_record(DROPPED, numbers[channel], one.first, one.last, 0)
        else:
            record = one[1]
            yield encode_record(
                MESSAGE, numbers[channel], record.sequence, record.stamp_ns, record.spooled_ns, record.body
            )
