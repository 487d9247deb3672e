"""Reads an MCAP file in its own order, damaged or not: what is whole comes out, what is not is named.

A wrong checksum loses its chunk only. Where a record's length makes no sense the next compressed chunk that
checks is looked for. Channels come from the summary, if that is whole, and from the chunks otherwise.
"""

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, Footer, Header, Metadata, MetadataIndex, Schema
from mcap.writer import MCAP0_MAGIC

from trigpoint.errors import LogDamaged
from trigpoint.logs.channels import ChannelKey, channel_key
from trigpoint.logs.chunks import CHUNK_LIMIT_BYTES, FRAME, definitions, messages, parsed, record_bytes, unpacked
from trigpoint.logs.file_bytes import FileBytes
from trigpoint.logs.mcap_writer import LIBRARY

MAGIC = bytes(MCAP0_MAGIC)
FOOTER_BYTES = FRAME.size + 8 + 8 + 4
DATA_END_BYTES = FRAME.size + 4
INDEX_HEAD_BYTES = FRAME.size + 2 + 4  # up to the entries of a message index: channel and their size in bytes
INDEX_SIZE = struct.Struct("<I")
CHUNK_HEAD_BYTES = FRAME.size + 8 + 8 + 8 + 4  # up to the name of the compression
COMPRESSION_NAMES = (b"\x04\x00\x00\x00zstd", b"\x03\x00\x00\x00lz4")
KNOWN_OPCODES = frozenset(int(opcode) for opcode in Opcode)
PRIVATE_OPCODES = 0x80  # this and above: an application's own, to be skipped
UNKNOWN = -1  # messages lost
RECORD_LIMIT_BYTES = CHUNK_LIMIT_BYTES + 1024 * 1024  # of one that is read: what does not compress fits in
DEFINITIONS_LIMIT_BYTES = 64 * 1024 * 1024  # of all schemas, channels and metadata of a file
SUMMARY_LIMIT_BYTES = RECORD_LIMIT_BYTES
METADATA_LIMIT, DAMAGES_LIMIT = 10_000, 1_000  # records; entries, the last of which stands for all behind it
READ_OPCODES = frozenset(
    {Opcode.CHUNK, Opcode.MESSAGE, Opcode.DATA_END, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA}
)


@dataclass(frozen=True, slots=True)
class Damage:
    """Something in a file that is not as it was written: where, in bytes, what, and how many messages it cost.

    `lost_messages` is -1 where nothing left in the file tells their number.
    """

    path: Path
    offset: int
    reason: str
    lost_messages: int = UNKNOWN

    def __str__(self) -> str:
        lost = "an unknown number of" if self.lost_messages == UNKNOWN else str(self.lost_messages)
        return f"{self.path}, byte {self.offset}: {self.reason}; {lost} messages lost"


@dataclass(frozen=True, slots=True)
class ScannedChunk:
    """A whole chunk: where it stands, in bytes, and its records, uncompressed and checked."""

    offset: int
    length: int
    start_ns: int
    end_ns: int
    data: bytes


class McapScan:
    """One pass over a file; `chunks` has to be exhausted before the rest is true."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.channels: dict[int, ChannelKey] = {}
        self.channel_records: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self.metadata: dict[str, Mapping[str, str]] = {}
        self.metadata_indexes: list[MetadataIndex] = []
        self.damages: list[Damage] = []
        self.finished = False  # the data section has its end
        self.whole_end = 0  # where the last whole chunk ends, in bytes
        self._checksums_required = False
        self.summary_fault = "no summary was read"  # "" for a whole one
        self._channels_settled = False  # by the summary
        self._kept_bytes = 0  # of definitions and metadata
        self._lost_chunk = False  # the last chunk was damaged: its message indexes tell its count

    @property
    def complete(self) -> bool:
        """The file has its end and its summary; its data section may be damaged all the same."""
        return self.finished and not self.summary_fault

    @property
    def torn_tail(self) -> bool:
        """The file was being written when its writer stopped, and nothing before its last whole chunk is damaged."""
        return not self.complete and all(damage.offset >= self.whole_end for damage in self.damages)

    @property
    def loss(self) -> Damage | None:
        """The first damage that cost messages, a torn tail apart."""
        lossy = (damage for damage in self.damages if damage.lost_messages)
        return None if self.torn_tail else next(lossy, None)

    def chunks(self) -> Iterator[ScannedChunk]:
        """Every whole chunk, in the order of the file. A message outside of chunks counts as its own."""
        with FileBytes(self.path) as content:
            self._checksums_required = _is_our_own(content)
            self.summary_fault = self._read_summary(content)
            offset = self._start(content)
            while not self.finished and offset < content.size_bytes:
                following, known = self._following(content, offset), len(self.damages)
                if following > offset:
                    yield from self._record(content, offset, following)
                if following == offset:
                    offset = self._resumed(content, offset)
                elif len(self.damages) > known:  # its length may be wrong as well
                    offset = self._next_chunk(content, offset + 1, following)
                else:
                    offset = following
            if not self.finished:
                self._damaged(content.size_bytes, "file ends without the end of its data section", lost=0)

    def _resumed(self, content: FileBytes, offset: int) -> int:
        """Where reading goes on after no record was found at `offset`: a wrong length may have led there, past chunks
        that are whole, so that what lies behind the last one read is looked through again."""
        trusted = max(self.whole_end, len(MAGIC))
        following = self._next_chunk(content, trusted, content.size_bytes)
        if following < offset:
            self.damages[-1] = replace(self.damages[-1], offset=trusted)
        return following

    def _start(self, content: FileBytes) -> int:
        head = content.read(0, len(MAGIC))
        if head != MAGIC:
            self._damaged(0, f"file of {content.size_bytes} bytes starts with {head!r}, expected {MAGIC!r}", lost=0)
        return len(MAGIC)

    def _following(self, content: FileBytes, offset: int) -> int:
        """The end of the record at `offset`; `offset` itself, and the damage noted, if there is no such record."""
        head = content.read(offset, offset + FRAME.size)
        if len(head) < FRAME.size:
            self._damaged(offset, f"{len(head)} bytes at the end, a record has at least {FRAME.size}")
            return offset
        opcode, length = FRAME.unpack(head)
        following: int = offset + FRAME.size + length
        if following > content.size_bytes:
            self._damaged(offset, f"record {opcode} of {length} bytes reaches past the end at {content.size_bytes}")
            return offset
        if opcode in READ_OPCODES and length > RECORD_LIMIT_BYTES:
            self._damaged(offset, f"record {opcode} of {length} bytes, at most {RECORD_LIMIT_BYTES} are read")
            return offset
        if opcode not in KNOWN_OPCODES and opcode < PRIVATE_OPCODES:
            self._damaged(offset, f"record of {length} bytes has the unknown opcode {opcode}")
            return offset
        return following

    def _record(self, content: FileBytes, offset: int, following: int) -> Iterator[ScannedChunk]:
        opcode = content.read(offset, offset + 1)[0]
        record = content.read(offset, following if opcode in READ_OPCODES else offset + INDEX_HEAD_BYTES)
        try:
            if opcode in (Opcode.CHUNK, Opcode.MESSAGE):
                self._lost_chunk = False
                chunk = self._chunk(record, offset)
                self.whole_end = offset + chunk.length
                yield chunk
            elif _stands_for_chunk(content, offset):
                raise LogDamaged(f"record {opcode} of {following - offset} bytes holds what a chunk does")
            elif opcode == Opcode.DATA_END:
                self._end_of_data(content, offset, following)
            else:
                self._side_record(record, offset, following - offset)
        except LogDamaged as error:
            costly = opcode in (Opcode.CHUNK, Opcode.MESSAGE) or _stands_for_chunk(content, offset)
            miscounted = self._lost_chunk and opcode == Opcode.MESSAGE_INDEX
            self._lost_chunk = self._lost_chunk or opcode == Opcode.CHUNK
            self._damaged(offset, str(error), lost=UNKNOWN if costly or miscounted else 0)

    def _chunk(self, record: bytes, offset: int) -> ScannedChunk:
        if record[0] == Opcode.MESSAGE and self._checksums_required:
            raise LogDamaged(f"message of {len(record)} bytes outside of a chunk, where none was written")
        if record[0] == Opcode.MESSAGE:
            (message,) = messages(record)
            return ScannedChunk(offset, len(record), message.log_time_ns, message.log_time_ns, record)
        chunk = parsed(Chunk, record[FRAME.size :])
        data = unpacked(chunk, checksum_required=self._checksums_required)
        count, held = 0, (0, 0)
        for message in messages(data):
            stamp_ns = message.log_time_ns
            held = (min(held[0], stamp_ns), max(held[1], stamp_ns)) if count else (stamp_ns, stamp_ns)
            count += 1
        self._learn(data)
        if count and held != (chunk.message_start_time, chunk.message_end_time):
            said = f"[{chunk.message_start_time}, {chunk.message_end_time}]"
            self._damaged(offset, f"chunk's header says times {said} ns, its messages have {list(held)}", lost=0)
        length = CHUNK_HEAD_BYTES + 4 + len(chunk.compression.encode()) + 8 + len(chunk.data)
        if length != len(record):
            self._damaged(offset, f"record of {len(record)} bytes holds a chunk of {length}", lost=0)
        return ScannedChunk(offset, length, *held, data)

    def _side_record(self, record: bytes, offset: int, length: int) -> None:
        opcode, body = record[0], record[FRAME.size :]
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            self._learn(record)
        elif opcode == Opcode.METADATA:
            metadata = parsed(Metadata, body)
            self._keep(length)
            if len(self.metadata_indexes) >= METADATA_LIMIT:
                raise LogDamaged(f"more than {METADATA_LIMIT} metadata records: not kept")
            self.metadata[metadata.name] = metadata.metadata
            self.metadata_indexes.append(MetadataIndex(offset=offset, length=length, name=metadata.name))
        elif opcode == Opcode.MESSAGE_INDEX:
            count = index_count(record, length)
            if self._lost_chunk:
                self._count_lost(count)

    def _count_lost(self, count: int) -> None:
        """A message index after a damaged chunk says how many messages of one channel it held."""
        damage = self.damages[-1]
        if len(self.damages) < DAMAGES_LIMIT:
            self.damages[-1] = replace(damage, lost_messages=max(damage.lost_messages, 0) + count)

    def _learn(self, records: bytes) -> None:
        """Schemas and channels taken over, unless the summary has settled them. Raises LogDamaged."""
        for definition, length in definitions(records):
            if self._channels_settled:
                continue
            if isinstance(definition, Schema):
                if self.schemas.get(definition.id) != definition:
                    self._keep(length)
                self.schemas[definition.id] = definition
            elif self.channel_records.get(definition.id) != definition:
                self._keep(length)
                self._learn_channel(definition)

    def _learn_channel(self, channel: Channel) -> None:
        schema = self.schemas.get(channel.schema_id)
        try:
            self.channels[channel.id] = channel_key(channel, schema_name=schema.name if schema else "")
        except ValueError as error:
            raise LogDamaged(f"channel {channel.id} has no number as its sequence base: {error}") from error
        self.channel_records[channel.id] = channel

    def _keep(self, length: int) -> None:
        """So many bytes more of definitions and metadata in memory. Raises LogDamaged for too many."""
        if self._kept_bytes + length > DEFINITIONS_LIMIT_BYTES:
            raise LogDamaged(f"definitions of {self._kept_bytes + length} bytes, at most {DEFINITIONS_LIMIT_BYTES}")
        self._kept_bytes += length

    def _next_chunk(self, content: FileBytes, offset: int, stop: int) -> int:
        """Where the next chunk before `stop` that checks starts, or `stop`."""
        while True:
            found = (content.find(name, offset + CHUNK_HEAD_BYTES, stop) for name in COMPRESSION_NAMES)
            start = min((position - CHUNK_HEAD_BYTES for position in found if position >= 0), default=None)
            if start is None:
                return stop
            if _is_whole_chunk(content, start):
                return start
            offset = start + 1

    def _end_of_data(self, content: FileBytes, offset: int, following: int) -> None:
        if following - offset != DATA_END_BYTES:
            raise LogDamaged(f"end of the data section of {following - offset} bytes, it has {DATA_END_BYTES}")
        said = parsed(DataEnd, content.read(offset + FRAME.size, following)).data_section_crc
        if (said or self._checksums_required) and not self.damages:
            held = content.checksum(0, offset)
            if said != held:
                self._damaged(offset, f"data section has checksum {held:08x}, its end says {said:08x}", lost=0)
        self.finished = True
        if self.summary_fault:
            self._damaged(following, self.summary_fault, lost=0)

    def _read_summary(self, content: FileBytes) -> str:
        """What is wrong with the summary, "" if nothing; channels as it names them then."""
        footer_start = content.size_bytes - len(MAGIC) - FOOTER_BYTES
        tail = content.read(max(footer_start, 0), content.size_bytes)
        if tail[FOOTER_BYTES:] != MAGIC or FRAME.unpack_from(tail) != (Opcode.FOOTER, FOOTER_BYTES - FRAME.size):
            return "file does not end with a footer"
        footer = parsed(Footer, tail[FRAME.size : FOOTER_BYTES])
        start, said = footer.summary_start or footer_start, footer.summary_crc
        if not len(MAGIC) + DATA_END_BYTES <= start <= footer_start:
            return f"summary starts at {start}, its footer at {footer_start}"
        if footer_start - start > SUMMARY_LIMIT_BYTES:
            return f"summary of {footer_start - start} bytes, at most {SUMMARY_LIMIT_BYTES} are read"
        held = content.checksum(start, content.size_bytes - len(MAGIC) - 4)
        if said != held and (said or self._checksums_required):
            return f"summary has checksum {held:08x}, the footer says {said:08x}"
        if content.read(start - DATA_END_BYTES, start - 4) != FRAME.pack(Opcode.DATA_END, 4):
            return f"summary starts at {start}, no end of a data section stands before it"
        try:
            self._learn(content.read(start, footer_start))
        except LogDamaged as error:
            return f"summary at {start}: {error}"
        self._channels_settled = bool(self.channels)
        return ""

    def _damaged(self, offset: int, reason: str, *, lost: int = UNKNOWN) -> None:
        if len(self.damages) < DAMAGES_LIMIT:
            self.damages.append(Damage(self.path, offset, reason, lost))
        elif len(self.damages) == DAMAGES_LIMIT:
            self.damages.append(Damage(self.path, offset, f"{reason}; what follows is not listed"))


def index_count(head: bytes, length: int) -> int:
    """How many messages an index record of `length` bytes that begins with `head` lists. Raises LogDamaged."""
    listed = length - INDEX_HEAD_BYTES
    if len(head) < INDEX_HEAD_BYTES or listed != INDEX_SIZE.unpack_from(head, INDEX_HEAD_BYTES - 4)[0] or listed % 16:
        raise LogDamaged(f"message index of {length} bytes has another length inside")
    return listed // 16


def _is_our_own(content: FileBytes) -> bool:
    """Whether the header names our writer, which gives everything a checksum; others may leave them out."""
    head = Header(profile="", library=LIBRARY)
    return content.read(len(MAGIC), len(MAGIC) + len(record_bytes(head))) == record_bytes(head)


def _stands_for_chunk(content: FileBytes, offset: int) -> bool:
    """Whether a record is laid out as a compressed chunk, whatever its opcode says."""
    name = content.read(offset + CHUNK_HEAD_BYTES, offset + CHUNK_HEAD_BYTES + max(map(len, COMPRESSION_NAMES)))
    return name.startswith(COMPRESSION_NAMES)


def _is_whole_chunk(content: FileBytes, offset: int) -> bool:
    head = content.read(offset, offset + FRAME.size)
    opcode, length = FRAME.unpack(head)
    if opcode != Opcode.CHUNK or offset + FRAME.size + length > content.size_bytes:
        return False
    try:
        chunk = parsed(Chunk, content.read(offset + FRAME.size, offset + FRAME.size + length))
        unpacked(chunk, checksum_required=False)
    except LogDamaged:
        return False
    return True
