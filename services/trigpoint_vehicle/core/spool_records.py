"""The bytes of a spool's segment: records one behind the other, each with a checksum of its own.

A record, little-endian: CRC-32 of all that follows u32, size of its body u32, kind u8, mark 0xA5, channel u16,
sequence i64, stamp in ns i64, time of spooling in ns i64, body. What the fields mean depends on the kind:

- SEGMENT, the first of a file: body is the vehicle and the boot that writes it, `sequence` the boot's next number
  (-1: unknown).
- CHANNEL, before a channel is used: body is source, boot id, schema name, and "n" where its numbers leave no gaps.
- MESSAGE: body is the payload.
- SEALED, the last of a file that was closed in order: it holds `sequence` messages with `stamp` bytes of payload.
- DROPPED: messages `sequence` to `stamp` (both included) of the channel's boot were dropped, unsent.
"""

import struct
import zlib
from dataclasses import dataclass
from typing import NamedTuple

from trigpoint.errors import InputError, LogDamaged

SEGMENT, CHANNEL, MESSAGE, DROPPED, SEALED = 1, 2, 3, 4, 5
KINDS = frozenset((SEGMENT, CHANNEL, MESSAGE, DROPPED, SEALED))
FORMAT = "trigpoint spool 1"
MARK = 0xA5
_CRC = struct.Struct("<I")
_FIELDS = struct.Struct("<IBBHqqq")
_HEAD = struct.Struct("<IIBBHqqq")
HEAD_BYTES = _HEAD.size
_MARK_AT = 9  # bytes from a record's beginning
NUMBERED = "n"
NUL = "\0"


class Record(NamedTuple):
    """A whole record; a tuple, as there are many a second."""

    kind: int
    channel: int
    sequence: int
    stamp_ns: int
    spooled_ns: int
    body: bytes


@dataclass(frozen=True, slots=True, eq=False)
class SpoolChannel:
    """What many messages have in common; `numbered` where the numbers leave no gaps of their own.

    Compared by identity, as that is done for every message.
    """

    source: str
    boot_id: str
    schema_name: str
    numbered: bool


def encode_record(kind: int, channel: int, sequence: int, stamp_ns: int, spooled_ns: int, body: bytes = b"") -> bytes:
    """The record's bytes. Raises InputError for a value that does not fit its field."""
    try:
        fields = _FIELDS.pack(len(body), kind, MARK, channel, sequence, stamp_ns, spooled_ns)
    except struct.error as error:
        raise InputError(f"sequence {sequence} at {stamp_ns} ns: signed 64 bits are the limit: {error}") from error
    return _CRC.pack(zlib.crc32(body, zlib.crc32(fields))) + fields + body


def whole_records(data: bytes, at: int, *, count: int) -> tuple[list[Record], int]:
    """Up to `count` whole records from there on, and where they end; fewer if the data end or are damaged there."""
    records: list[Record] = []
    view, length, unpack, crc32 = memoryview(data), len(data), _HEAD.unpack_from, zlib.crc32
    while len(records) < count and at + HEAD_BYTES <= length:
        crc, size, kind, mark, channel, sequence, stamp_ns, spooled_ns = unpack(data, at)
        end = at + HEAD_BYTES + size
        if mark != MARK or kind not in KINDS or end > length or crc32(view[at + _CRC.size : end]) != crc:
            break
        records.append(Record(kind, channel, sequence, stamp_ns, spooled_ns, data[at + HEAD_BYTES : end]))
        at = end
    return records, at


def next_whole_record(data: bytes, after: int) -> int:
    """Where the first whole record behind a damaged one begins; the end of the data if there is none."""
    mark_at = data.find(MARK, after + _MARK_AT + 1)
    while mark_at >= 0:
        if whole_records(data, mark_at - _MARK_AT, count=1)[0]:
            return mark_at - _MARK_AT
        mark_at = data.find(MARK, mark_at + 1)
    return len(data)


def segment_record(vehicle: str, boot_id: str, *, next_sequence: int, spooled_ns: int) -> bytes:
    """The record a segment begins with."""
    return encode_record(SEGMENT, 0, next_sequence, 0, spooled_ns, NUL.join((FORMAT, vehicle, boot_id)).encode())


def segment_of(record: Record) -> tuple[str, str]:
    """Vehicle and boot of the record a segment begins with. Raises LogDamaged for anything else."""
    names = record.body.decode(errors="replace").split(NUL)
    if record.kind != SEGMENT or len(names) != 3 or names[0] != FORMAT:
        raise LogDamaged(f"no segment of a spool: it begins with record kind {record.kind}, not with {FORMAT!r}")
    return names[1], names[2]


def channel_record(number: int, channel: SpoolChannel) -> bytes:
    """The record that gives a channel its number. Raises InputError for a name with a NUL in it."""
    names = (channel.source, channel.boot_id, channel.schema_name, NUMBERED if channel.numbered else "")
    if any(NUL in name for name in names):
        raise InputError(f"{names[:3]}: a NUL is in one of the names, none is allowed")
    return encode_record(CHANNEL, number, 0, 0, 0, NUL.join(names).encode())


def channel_of(record: Record) -> SpoolChannel:
    """The channel a record defines. Raises LogDamaged if its body is none."""
    names = record.body.decode(errors="replace").split(NUL)
    if len(names) != 4:
        raise LogDamaged(f"channel {record.channel} has {len(names)} names, expected 4")
    return SpoolChannel(names[0], names[1], names[2], names[3] == NUMBERED)
