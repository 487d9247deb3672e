"""Writes MCAP files whose bytes depend on what is written and nothing else."""

import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Protocol

import numpy as np
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

from trigpoint.logs.channels import ENCODING, ChannelKey, PackedRows, channel_record, schema_data
from trigpoint.logs.chunks import PackedChunk, built, message_index_bytes, pack, record_bytes

LIBRARY = "trigpoint"  # without a version: it would change the bytes of the same log
CHUNK_BYTES = 128 * 1024  # of payload: a time query decompresses little, and zstd still finds its repetitions
CHANNEL_LIMIT = 65_535  # channel ids are uint16, and 0 is left out


class Output(Protocol):
    """Where bytes go."""

    def write(self, data: bytes, /) -> int | None:
        """How many of the bytes were taken."""


@dataclass(frozen=True, slots=True)
class WrittenChunk:
    """Where a chunk stands in its file, in bytes, and what it holds."""

    offset: int
    length: int
    count: int
    start_ns: int
    end_ns: int
    channel_ids: tuple[int, ...]


@dataclass(slots=True)
class FileIndex:
    """What the summary at the end of a file says of it; grows while the file does, by some hundred bytes a chunk:
    `chunk_indexes` are records as they will stand there."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunk_indexes: bytearray = field(default_factory=bytearray)
    chunk_count: int = 0
    start_ns: int = 0  # of the earliest message, 0 before there is one
    end_ns: int = 0
    metadata: list[MetadataIndex] = field(default_factory=list)
    count_by_channel: dict[int, int] = field(default_factory=dict)

    def add_chunk(self, packed: PackedChunk, offset: int) -> tuple[int, bytes]:
        """The length of a chunk at this offset, and the bytes of it and of its message indexes, entered into the
        index."""
        chunk, tail, index_offsets = record_bytes(packed.record), [], {}
        position = offset + len(chunk)
        for channel_id, entries in packed.index_by_channel.items():
            tail.append(message_index_bytes(channel_id, entries))
            index_offsets[channel_id] = position
            position += len(tail[-1])
            self.count_by_channel[channel_id] = self.count_by_channel.get(channel_id, 0) + len(entries)
        index_length = position - offset - len(chunk)
        self.chunk_indexes += record_bytes(_chunk_index(packed, offset, len(chunk), index_offsets, index_length))
        start_ns, end_ns = packed.record.message_start_time, packed.record.message_end_time
        self.start_ns = min(self.start_ns, start_ns) if self.chunk_count else start_ns
        self.end_ns = max(self.end_ns, end_ns)
        self.chunk_count += 1
        return len(chunk), b"".join([chunk, *tail])

    def ending(self, *, offset: int, data_crc: int) -> bytes:
        """Everything that ends a file whose data section ends at `offset` with this checksum."""
        data_end = record_bytes(DataEnd(data_section_crc=data_crc))
        summary_start = offset + len(data_end)
        summary, groups = b"", b""
        for opcode, group in self._groups():
            if group:
                start = summary_start + len(summary)
                groups += record_bytes(SummaryOffset(group_opcode=opcode, group_start=start, group_length=len(group)))
            summary += group
        offsets_start = summary_start + len(summary)
        footer_head = struct.pack("<BQQQ", Opcode.FOOTER, 8 + 8 + 4, summary_start, offsets_start)
        checksum = zlib.crc32(summary + groups + footer_head)
        footer = record_bytes(Footer(summary_start, offsets_start, checksum))
        return data_end + summary + groups + footer + bytes(MCAP0_MAGIC)

    def _groups(self) -> Iterator[tuple[Opcode, bytes]]:
        yield Opcode.SCHEMA, _records_bytes(self.schemas.values())
        yield Opcode.CHANNEL, _records_bytes(self.channels.values())
        yield Opcode.STATISTICS, record_bytes(self._statistics())
        yield Opcode.CHUNK_INDEX, bytes(self.chunk_indexes)
        yield Opcode.METADATA_INDEX, _records_bytes(self.metadata)

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=0,
            channel_count=len(self.channels),
            channel_message_counts=dict(sorted(self.count_by_channel.items())),
            chunk_count=self.chunk_count,
            message_count=sum(self.count_by_channel.values()),
            message_end_time=self.end_ns,
            message_start_time=self.start_ns,
            metadata_count=len(self.metadata),
            schema_count=len(self.schemas),
        )


def _records_bytes(records: Iterable[McapRecord]) -> bytes:
    return b"".join(record_bytes(record) for record in records)


def _chunk_index(
    packed: PackedChunk, offset: int, length: int, index_offsets: dict[int, int], index_length: int
) -> ChunkIndex:
    return ChunkIndex(
        chunk_length=length,
        chunk_start_offset=offset,
        compression=packed.record.compression,
        compressed_size=len(packed.record.data),
        message_end_time=packed.record.message_end_time,
        message_index_length=index_length,
        message_index_offsets=index_offsets,
        message_start_time=packed.record.message_start_time,
        uncompressed_size=packed.record.uncompressed_size,
    )


class McapFileWriter:
    """One MCAP file being written; bytes reach the output with each `append` and with `finish`."""

    def __init__(
        self,
        output: Output,
        *,
        metadata: Mapping[str, Mapping[str, str]],
        schemas: Mapping[str, bytes] = MappingProxyType({}),
    ) -> None:
        """`schemas`: descriptors by name, for those that may be unknown here."""
        self._output, self._schemas = output, schemas
        self._index = FileIndex()
        self._data_crc = 0
        self._channel_ids: dict[ChannelKey, int] = {}
        self._schema_ids: dict[str, int] = {}
        self._position = 0
        self._head = self._opening(metadata)

    @property
    def size_bytes(self) -> int:
        """How long the file is by now."""
        return self._position

    @property
    def channels(self) -> Mapping[ChannelKey, int]:
        """The channels in use and their ids."""
        return self._channel_ids

    def append(self, rows: PackedRows) -> tuple[WrittenChunk, ...]:
        """The chunks the rows were written in, in order. Raises OSError as the output does."""
        head, self._head = self._head, b""
        self._write(head)
        return tuple(self._append_chunk(group) for group in _groups_of_rows(rows))

    def finish(self) -> None:
        """The file ended with its summary; nothing can be appended any more."""
        head, self._head = self._head, b""
        self._write(head)
        self._write(self._index.ending(offset=self._position, data_crc=self._data_crc))

    def _opening(self, metadata: Mapping[str, Mapping[str, str]]) -> bytes:
        head = bytes(MCAP0_MAGIC) + record_bytes(Header(profile="", library=LIBRARY))
        for name, values in metadata.items():
            data = record_bytes(Metadata(name=name, metadata=dict(values)))
            self._index.metadata.append(MetadataIndex(offset=len(head), length=len(data), name=name))
            head += data
        return head

    def _append_chunk(self, rows: PackedRows) -> WrittenChunk:
        builder = RecordBuilder()
        id_of_channel = np.zeros(len(rows.channels), dtype=np.int64)
        for number in dict.fromkeys(rows.channel_of_row.tolist()):
            key = rows.channels[number]
            id_of_channel[number] = self._channel_ids.get(key) or self._add_channel(key, builder)
        packed, offset = pack(rows, id_of_channel[rows.channel_of_row], built(builder)), self._position
        length, data = self._index.add_chunk(packed, offset)
        self._write(data)
        return WrittenChunk(
            offset=offset,
            length=length,
            count=packed.count,
            start_ns=packed.record.message_start_time,
            end_ns=packed.record.message_end_time,
            channel_ids=tuple(packed.index_by_channel),
        )

    def _add_channel(self, key: ChannelKey, builder: RecordBuilder) -> int:
        schema_id = self._schema_ids.get(key.schema_name) or self._add_schema(key.schema_name, builder)
        channel_id = len(self._channel_ids) + 1
        channel = channel_record(key, channel_id=channel_id, schema_id=schema_id)
        self._channel_ids[key] = channel_id
        self._index.channels[channel_id] = channel
        channel.write(builder)
        return channel_id

    def _add_schema(self, name: str, builder: RecordBuilder) -> int:
        schema_id = len(self._schema_ids) + 1
        data = self._schemas[name] if name in self._schemas else schema_data(name)
        schema = Schema(id=schema_id, data=data, encoding=ENCODING, name=name)
        self._schema_ids[name] = schema_id
        self._index.schemas[schema_id] = schema
        schema.write(builder)
        return schema_id

    def _write(self, data: bytes) -> None:
        remaining = memoryview(data)
        while remaining:
            remaining = remaining[self._output.write(bytes(remaining)) or 0 :]
        self._data_crc = zlib.crc32(data, self._data_crc)
        self._position += len(data)


def _groups_of_rows(rows: PackedRows) -> Iterator[PackedRows]:
    """The rows cut into runs of about CHUNK_BYTES of payload; a larger one is alone, so that who wants the others need
    not unpack it."""
    if 0 < sum(map(len, rows.payloads)) < CHUNK_BYTES:
        yield rows
        return
    start, size = 0, 0
    for index, payload in enumerate(rows.payloads):
        if size and len(payload) >= CHUNK_BYTES:
            yield rows.part(start, index)
            start, size = index, 0
        size += len(payload)
        if size >= CHUNK_BYTES:
            yield rows.part(start, index + 1)
            start, size = index + 1, 0
    if start < len(rows.payloads):
        yield rows.part(start, len(rows.payloads))
