"""Who said what when, of a whole chunk at once: identities and times of its events, and their payloads undecoded."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from trigpoint.errors import LogDamaged
from trigpoint.events.runs import EncodedRun
from trigpoint.logs.channels import ChannelKey
from trigpoint.logs.chunks import FRAME, MESSAGE, MESSAGE_FIXED_BYTES, messages

LENGTH_AT = 1  # bytes from where a message begins
CHANNEL_AT, SEQUENCE_AT, TIME_AT = FRAME.size, FRAME.size + 2, FRAME.size + 6
INDEX_HEAD_BYTES, INDEX_ENTRY_BYTES = FRAME.size + 2 + 4, 16

Columns = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]


def index_bytes(count: int, channel_count: int) -> int:
    """How long the message indexes are that stand behind a chunk."""
    return INDEX_ENTRY_BYTES * count + INDEX_HEAD_BYTES * channel_count


def chunk_headers(data: bytes, indexes: bytes, count: int, channels: Mapping[int, ChannelKey]) -> Iterator[EncodedRun]:
    """The `count` events of a chunk's records, in order, as runs without payloads; `indexes` are its message indexes.

    Where those are not what belongs to the records, each message is looked at instead. Raises LogDamaged for records
    that do not fill the chunk.
    """
    offsets = _offsets(indexes, count, len(data))
    columns = _read_out(data, offsets) if offsets is not None else _looked_at(data)
    for _, run in _runs(columns, channels, None):
        yield run


def chunk_runs(
    data: bytes, indexes: bytes, count: int, channels: Mapping[int, ChannelKey]
) -> Iterator[tuple[int, EncodedRun]]:
    """The events of a chunk's records that are in one of the channels, in order, as runs: each with the place of its
    first event among all `count`. Events of a run stand one behind the other.

    Raises LogDamaged for records that do not fill the chunk, and for a time beyond 64 bits.
    """
    offsets = _offsets(indexes, count, len(data))
    ends = None if offsets is None else _ends(data, offsets)
    if offsets is None or ends is None:
        offsets = np.array([message.offset for message in messages(data)], dtype=np.int64)
        ends = offsets + FRAME.size + _column(data, offsets + LENGTH_AT, "<u8")
    columns = _read_out(data, offsets)
    if len(offsets) and int(columns[2].min()) < 0:
        raise LogDamaged("a message's time is beyond 64 bits")
    starts = (offsets + MESSAGE.size).tolist()
    yield from _runs(columns, channels, [data[a:b] for a, b in zip(starts, ends.tolist(), strict=True)])


def _runs(
    columns: Columns, channels: Mapping[int, ChannelKey], payloads: list[bytes] | None
) -> Iterator[tuple[int, EncodedRun]]:
    channel_ids, mcap_sequences, stamps_ns = columns
    drives = {number: (key.source, key.boot_id) for number, key in channels.items()}
    numbers = {drive: index for index, drive in enumerate(dict.fromkeys(drives.values()))}
    drive_of_channel = {number: numbers[drive] for number, drive in drives.items()}
    drive_of_row = np.array([drive_of_channel.get(number, -1) for number in channel_ids.tolist()], dtype=np.int64)
    edges = [0, *(np.flatnonzero(np.diff(drive_of_row)) + 1).tolist(), len(drive_of_row)]
    for start, stop in zip(edges, edges[1:], strict=False):
        if start < stop and drive_of_row[start] >= 0:
            own = (channel_ids[start:stop], mcap_sequences[start:stop], stamps_ns[start:stop])
            yield start, _run(own, channels, payloads[start:stop] if payloads is not None else ())


def _run(columns: Columns, channels: Mapping[int, ChannelKey], payloads: Sequence[bytes]) -> EncodedRun:
    """Events of one source and boot."""
    channel_ids, mcap_sequences, stamps_ns = columns
    used, channel_of_row = np.unique(channel_ids, return_inverse=True)
    keys = [channels[number] for number in used.tolist()]
    schemas = tuple(dict.fromkeys(key.schema_name for key in keys))
    schema_of_channel = np.array([schemas.index(key.schema_name) for key in keys], dtype=np.int64)
    bases = np.array([key.sequence_base for key in keys], dtype=np.int64)
    return EncodedRun(
        source=keys[0].source,
        boot_id=keys[0].boot_id,
        schemas=schemas,
        schema_of_row=schema_of_channel[channel_of_row],
        sequences=mcap_sequences + bases[channel_of_row],
        stamps_ns=stamps_ns,
        payloads=payloads,
    )


def _offsets(indexes: bytes, count: int, size: int) -> NDArray[np.int64] | None:
    """Where the messages begin in the records, ascending; None where the indexes cannot be those of the chunk."""
    parts, at = [], 0
    while at + INDEX_HEAD_BYTES <= len(indexes):
        length = int.from_bytes(indexes[at + INDEX_HEAD_BYTES - 4 : at + INDEX_HEAD_BYTES], "little")
        entries = indexes[at + INDEX_HEAD_BYTES : at + INDEX_HEAD_BYTES + length]
        if len(entries) < length or length % INDEX_ENTRY_BYTES:
            return None
        parts.append(np.frombuffer(entries, dtype="<u8").reshape(-1, 2)[:, 1])
        at += INDEX_HEAD_BYTES + length
    offsets = np.sort(np.concatenate(parts).astype(np.int64)) if parts else np.empty(0, dtype=np.int64)
    fits = len(offsets) == count and count > 0 and offsets[0] >= 0 and offsets[-1] + TIME_AT + 8 <= size
    return offsets if fits else None


def _ends(data: bytes, offsets: NDArray[np.int64]) -> NDArray[np.int64] | None:
    """Where the messages end; None where these are not messages that stand one behind the other."""
    lengths = _column(data, offsets + LENGTH_AT, "<u8")
    opcodes = np.frombuffer(data, dtype=np.uint8)[offsets]
    if (opcodes != Opcode.MESSAGE).any() or lengths.min() < MESSAGE_FIXED_BYTES or lengths.max() > len(data):
        return None
    ends = offsets + FRAME.size + lengths
    return ends if ends[-1] <= len(data) and (ends[:-1] <= offsets[1:]).all() else None


def _read_out(data: bytes, offsets: NDArray[np.int64]) -> Columns:
    return (
        _column(data, offsets + CHANNEL_AT, "<u2"),
        _column(data, offsets + SEQUENCE_AT, "<u4"),
        _column(data, offsets + TIME_AT, "<u8"),
    )


def _column(data: bytes, places: NDArray[np.int64], kind: str) -> NDArray[np.int64]:
    """The whole numbers of a kind that stand at these bytes."""
    size = np.dtype(kind).itemsize
    every = np.ndarray((max(len(data) - size + 1, 0),), kind, data, strides=(1,))  # what begins at each byte
    return np.asarray(every[places].astype(np.int64))


def _looked_at(data: bytes) -> Columns:
    found = [(message.channel_id, message.mcap_sequence, message.log_time_ns) for message in messages(data)]
    try:
        table = np.array(found, dtype=np.int64).reshape(-1, 3)
    except OverflowError as error:
        raise LogDamaged(f"a message's time is beyond 64 bits: {error}") from error
    return table[:, 0], table[:, 1], table[:, 2]
