"""The inside of MCAP chunks: packed, compressed and checked."""

import struct
import threading
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from io import BytesIO
from itertools import chain
from typing import NamedTuple, Protocol, TypeVar

import lz4.frame  # type: ignore[import-untyped]  # ships no types
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Schema
from numpy.typing import NDArray

from trigpoint.errors import LogDamaged
from trigpoint.logs.channels import PackedRows

RecordT = TypeVar("RecordT", covariant=True)
MessageIndexes = Mapping[int, NDArray[np.uint64]]  # by channel: (n, 2) time in ns and offset of each message
FRAME = struct.Struct("<BQ")  # opcode and length of any record
MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
MESSAGE_FIXED_BYTES = MESSAGE.size - FRAME.size
_HEADS = np.dtype(  # many of MESSAGE, in the same bytes
    [("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("log", "<u8"), ("publish", "<u8")]
)
COMPRESSION = "zstd"
CHUNK_LIMIT_BYTES = 128 * 1024 * 1024  # unpacked: what a header may make us allocate; writers use some megabytes
COMPRESSION_LEVEL = 1  # packed doubles hardly get smaller above it: 3 takes twice as long for a twelfth of the size


class _Compressors(threading.local):
    """A compressor of each thread's own: making one takes longer than to compress a small chunk."""

    def __init__(self) -> None:
        self.own = zstandard.ZstdCompressor(level=COMPRESSION_LEVEL)


_COMPRESSORS = _Compressors()


class ChunkMessage(NamedTuple):
    """One message of a chunk; `offset` counts bytes from the start of the uncompressed records.

    A named tuple because hundreds of thousands are made in one replay.
    """

    channel_id: int
    mcap_sequence: int
    log_time_ns: int
    payload: bytes
    offset: int


@dataclass(frozen=True, slots=True)
class PackedChunk:
    """A chunk record and its message indexes."""

    record: Chunk
    index_by_channel: MessageIndexes

    @property
    def count(self) -> int:
        """How many messages the chunk holds."""
        return sum(len(entries) for entries in self.index_by_channel.values())


class Readable(Protocol[RecordT]):
    """A kind of MCAP record."""

    def read(self, stream: ReadDataStream) -> RecordT:
        """The record of this kind that the stream holds."""


def parsed(kind: Readable[RecordT], body: bytes) -> RecordT:
    """The record of this kind that the bytes hold. Raises LogDamaged if they hold none."""
    try:
        return kind.read(ReadDataStream(BytesIO(body)))
    except (McapError, struct.error, UnicodeDecodeError, OverflowError) as error:
        raise LogDamaged(f"record of {len(body)} bytes cannot be read: {error or type(error).__name__}") from error


def record_bytes(record: McapRecord) -> bytes:
    """The record as it stands in a file."""
    builder = RecordBuilder()
    record.write(builder)
    return built(builder)


def built(builder: RecordBuilder) -> bytes:
    """The bytes of all records a builder took."""
    data: bytes = builder.end()  # type: ignore[no-untyped-call]  # mcap leaves it without types
    return data


def pack(rows: PackedRows, channel_ids: NDArray[np.int64], definitions: bytes) -> PackedChunk:
    """A chunk of at least one row, each in the channel beside it; `definitions` are the records before them."""
    sizes = np.fromiter(map(len, rows.payloads), dtype=np.int64, count=len(rows.payloads)) + MESSAGE.size
    offsets = len(definitions) + np.cumsum(sizes) - sizes
    heads = np.empty(len(sizes), dtype=_HEADS)
    heads["opcode"], heads["length"] = int(Opcode.MESSAGE), sizes - FRAME.size
    heads["channel"], heads["sequence"] = channel_ids, rows.mcap_sequences
    heads["log"] = heads["publish"] = rows.stamps_ns
    packed = heads.tobytes()
    starts = range(0, len(packed), MESSAGE.size)
    parts = chain.from_iterable(zip((packed[s : s + MESSAGE.size] for s in starts), rows.payloads, strict=True))
    data = b"".join((definitions, *parts))
    return PackedChunk(_chunk(data, rows.stamps_ns), _indexes(channel_ids, rows.stamps_ns, offsets))


def _indexes(
    channel_ids: NDArray[np.int64], stamps_ns: NDArray[np.int64], offsets: NDArray[np.int64]
) -> MessageIndexes:
    """By channel, a channel's entries sorted by time, as readers want them."""
    entries = np.empty((len(offsets), 2), dtype="<u8")
    entries[:, 0], entries[:, 1] = stamps_ns, offsets
    used = sorted(set(channel_ids.tolist()))
    return {number: _by_time(entries if len(used) == 1 else entries[channel_ids == number]) for number in used}


def _by_time(entries: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """The entries of one channel, given by their offsets, by their times."""
    times = entries[:, 0]
    in_order = bool((times[1:] >= times[:-1]).all())
    return entries if in_order else entries[np.argsort(times, kind="stable")]


def message_index_bytes(channel_id: int, entries: NDArray[np.uint64]) -> bytes:
    """The message index record of one channel in a chunk, from (time, offset) of each message."""
    size = 16 * len(entries)
    head = FRAME.pack(Opcode.MESSAGE_INDEX, 2 + 4 + size) + struct.pack("<HI", channel_id, size)
    return head + entries.astype("<u8").tobytes()


def _chunk(data: bytes, stamps_ns: NDArray[np.int64]) -> Chunk:
    return Chunk(
        compression=COMPRESSION,
        data=_COMPRESSORS.own.compress(data),
        message_start_time=int(stamps_ns.min()),
        message_end_time=int(stamps_ns.max()),
        uncompressed_crc=zlib.crc32(data),
        uncompressed_size=len(data),
    )


def unpacked(chunk: Chunk, *, checksum_required: bool) -> bytes:
    """The chunk's records, checked. A checksum of 0 means there is none, unless one is required.

    Raises LogDamaged for a wrong checksum or size, or more than CHUNK_LIMIT_BYTES.
    """
    try:
        data = _decompressed(chunk)
    except (zstandard.ZstdError, RuntimeError, EOFError, OverflowError, MemoryError) as error:
        raise LogDamaged(f"chunk of {len(chunk.data)} bytes does not decompress: {error}") from error
    if len(data) != chunk.uncompressed_size:
        raise LogDamaged(f"chunk holds {len(data)} bytes, its header says {chunk.uncompressed_size}")
    if (chunk.uncompressed_crc or checksum_required) and zlib.crc32(data) != chunk.uncompressed_crc:
        raise LogDamaged(f"chunk has checksum {zlib.crc32(data):08x}, its header says {chunk.uncompressed_crc:08x}")
    return data


def _decompressed(chunk: Chunk) -> bytes:
    """Never more than the header says, and that never more than CHUNK_LIMIT_BYTES: nothing larger is allocated."""
    _within_limit(chunk.uncompressed_size)
    if chunk.compression == "zstd":
        _within_limit(zstandard.frame_content_size(chunk.data))
        return zstandard.decompress(chunk.data, max_output_size=chunk.uncompressed_size)
    if chunk.compression == "lz4":
        data: bytes = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=chunk.uncompressed_size)
        return data
    if chunk.compression:
        raise LogDamaged(f"chunk is compressed with {chunk.compression!r}: zstd, lz4 or nothing is read")
    return chunk.data


def _within_limit(size_bytes: int) -> None:
    if size_bytes > CHUNK_LIMIT_BYTES:
        raise LogDamaged(f"chunk says it holds {size_bytes} bytes, at most {CHUNK_LIMIT_BYTES} are unpacked")


def messages(data: bytes) -> Iterator[ChunkMessage]:
    """The messages among a chunk's records, in order. Raises LogDamaged if the records do not fill it exactly."""
    offset, end = 0, len(data)
    unpack, fixed, is_message = MESSAGE.unpack_from, MESSAGE.size, int(Opcode.MESSAGE)
    while offset < end:
        if end - offset < fixed or data[offset] != is_message:
            offset = _end_of_definition(data, offset)
            continue
        _, length, channel_id, sequence, log_time_ns, _ = unpack(data, offset)
        following = offset + FRAME.size + length
        if length < MESSAGE_FIXED_BYTES or following > end:
            raise LogDamaged(f"message of {length} bytes at {offset} does not fit into the chunk's {end}")
        yield ChunkMessage(channel_id, sequence, log_time_ns, data[offset + fixed : following], offset)
        offset = following


def _end_of_definition(data: bytes, offset: int) -> int:
    """Where the record that is no message ends. Raises LogDamaged if that is past the chunk's end."""
    length = FRAME.unpack_from(data, offset)[1] if len(data) - offset >= FRAME.size else len(data)
    following: int = offset + FRAME.size + length
    if following > len(data) or data[offset] == Opcode.MESSAGE:
        raise LogDamaged(f"record of {length} bytes at {offset} does not fit into the chunk's {len(data)}")
    return following


def definitions(data: bytes) -> Iterator[tuple[Schema | Channel, int]]:
    """The schemas and channels among a chunk's records, each with its size in bytes, in order.

    Raises LogDamaged for one that cannot be read.
    """
    offset = 0
    while offset + FRAME.size <= len(data):
        opcode, length = FRAME.unpack_from(data, offset)
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            body = data[offset + FRAME.size : offset + FRAME.size + length]
            yield parsed(Schema, body) if opcode == Opcode.SCHEMA else parsed(Channel, body), length
        offset += FRAME.size + length


def message_indexes(data: bytes) -> MessageIndexes:
    """The message index of each channel in a chunk, made anew from its records."""
    found = [(message.channel_id, message.log_time_ns, message.offset) for message in messages(data)]
    columns = np.array(found, dtype=np.int64).reshape(-1, 3)
    return _indexes(columns[:, 0], columns[:, 1], columns[:, 2])
