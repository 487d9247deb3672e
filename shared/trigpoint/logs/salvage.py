"""What is whole of one log file, damaged or not: its chunks, the numbers of their events, and these written anew."""

import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from mcap.records import ChunkIndex, Footer

from trigpoint.errors import LogDamaged
from trigpoint.logs.channels import ChannelKey, PackedRows
from trigpoint.logs.chunks import FRAME, ChunkMessage, messages, parsed
from trigpoint.logs.file_bytes import FileBytes
from trigpoint.logs.log_files import file_path
from trigpoint.logs.mcap_scan import FOOTER_BYTES, INDEX_HEAD_BYTES, MAGIC, UNKNOWN, Damage, McapScan, index_count
from trigpoint.logs.mcap_writer import McapFileWriter
from trigpoint.logs.numbering import NumberedPiece, Piece, numbered


@dataclass(frozen=True, slots=True)
class Knowledge:
    """What a catalog says of a file: by offset the number of a chunk's first event and how many, and the channels."""

    chunks: Mapping[int, tuple[int, int]]
    channels: Mapping[int, ChannelKey]


@dataclass(frozen=True, slots=True, kw_only=True)
class Salvage:
    """What of a file is whole: `pieces` in order of their numbers, metadata and schemas as far as they are readable."""

    path: Path
    first_number: int
    intact: bool
    pieces: tuple[NumberedPiece, ...]
    said_stop: int  # one more than the highest number its own index speaks of
    damages: tuple[Damage, ...]
    channels: Mapping[int, ChannelKey]
    metadata: Mapping[str, Mapping[str, str]]
    schemas: Mapping[str, bytes]

    @property
    def ranges(self) -> tuple[tuple[int, int], ...]:
        """The half-open ranges of numbers that are whole, neighbours joined."""
        return tuple((run[0].number, run[-1].number + run[-1].count) for run in _runs(self.pieces))


def salvaged(path: Path, *, stop_number: int | None, known: Knowledge) -> Salvage:
    """What is whole of a stream's file, which ends, if that is known, before `stop_number`. Only reads.

    A chunk with an event of a channel nobody knows counts as lost. Raises LogDamaged if it holds more than there is
    room for, OSError.
    """
    scan, whole = McapScan(path), []
    for chunk in scan.chunks():
        ids = [message.channel_id for message in messages(chunk.data)]
        named = set(ids) <= scan.channels.keys() | known.channels.keys()
        whole.append(Piece(chunk.offset, len(ids), lost=not named))
    lost = [
        Piece(damage.offset, None if damage.lost_messages == UNKNOWN else damage.lost_messages, lost=True)
        for damage in scan.damages
        if damage.lost_messages and not (scan.torn_tail and damage.offset >= scan.whole_end)
    ]
    pieces = sorted((*whole, *lost), key=lambda piece: piece.offset)
    first_number = int(path.stem)
    indexed = _indexed(scan, first_number)
    known_chunks = {**indexed, **known.chunks}
    found = numbered(pieces, first_number=first_number, stop_number=stop_number, known=known_chunks)
    if found and stop_number is not None and found[-1].number + found[-1].count > stop_number:
        raise LogDamaged(f"{path}: holds numbers up to {found[-1].number + found[-1].count}, {stop_number} stands next")
    return Salvage(
        path=path,
        first_number=first_number,
        intact=scan.complete and not scan.damages and not any(piece.lost for piece in pieces),
        pieces=found,
        said_stop=max((number + count for number, count in indexed.values()), default=first_number),
        damages=tuple(scan.damages),
        channels={**known.channels, **scan.channels},
        metadata=scan.metadata,
        schemas={schema.name: schema.data for schema in scan.schemas.values()},
    )


def _indexed(scan: McapScan, number: int) -> dict[int, tuple[int, int]]:
    """Number and count of each chunk as the file's own summary and message indexes say; nothing where they cannot."""
    if scan.summary_fault:
        return {}
    known = {}
    with FileBytes(scan.path) as content:
        try:
            for index in _chunk_indexes(content):
                count = sum(_index_count(content, offset) for offset in index.message_index_offsets.values())
                known[index.chunk_start_offset] = (number, count)
                number += count
        except LogDamaged:
            return known  # those before the damage
    return known


def _chunk_indexes(content: FileBytes) -> Iterator[ChunkIndex]:
    footer_start = content.size_bytes - len(MAGIC) - FOOTER_BYTES
    footer = parsed(Footer, content.read(footer_start + FRAME.size, footer_start + FOOTER_BYTES))
    offset = footer.summary_start or footer_start
    while offset + FRAME.size <= footer_start:
        opcode, length = FRAME.unpack(content.read(offset, offset + FRAME.size))
        if opcode == Opcode.CHUNK_INDEX:
            yield parsed(ChunkIndex, content.read(offset + FRAME.size, offset + FRAME.size + length))
        offset += FRAME.size + length


def _index_count(content: FileBytes, offset: int) -> int:
    head = content.read(offset, offset + INDEX_HEAD_BYTES)
    if len(head) < FRAME.size or head[0] != Opcode.MESSAGE_INDEX:
        raise LogDamaged(f"no message index at {offset}")
    return index_count(head, FRAME.size + FRAME.unpack_from(head)[1])


def write_salvage(salvage: Salvage, folder: Path) -> tuple[Path, ...]:
    """The files written into a stream's new folder, durable: the file as it is if it is whole, otherwise one for each
    run of numbers without gap. Raises OSError, LogDamaged if it changed meanwhile."""
    if salvage.intact:
        target = file_path(folder, salvage.first_number)
        shutil.copyfile(salvage.path, target)
        with target.open("rb") as file:
            os.fsync(file.fileno())
        return (target,)
    return tuple(_write_run(salvage, run, folder) for run in _runs(salvage.pieces))


def _runs(pieces: Sequence[NumberedPiece]) -> list[list[NumberedPiece]]:
    """The pieces with an event, parted where numbers are missing."""
    runs: list[list[NumberedPiece]] = []
    for piece in pieces:
        if not piece.count:
            continue
        if runs and runs[-1][-1].number + runs[-1][-1].count == piece.number:
            runs[-1].append(piece)
        else:
            runs.append([piece])
    return runs


def _write_run(salvage: Salvage, run: Sequence[NumberedPiece], folder: Path) -> Path:
    target, wanted = file_path(folder, run[0].number), {piece.offset for piece in run}
    with target.open("xb", buffering=0) as file:
        writer = McapFileWriter(file, metadata=salvage.metadata, schemas=salvage.schemas)
        for chunk in McapScan(salvage.path).chunks():
            if chunk.offset in wanted:
                wanted.remove(chunk.offset)
                writer.append(_rows(list(messages(chunk.data)), salvage.channels))
        writer.finish()
        os.fsync(file.fileno())
    if wanted:
        raise LogDamaged(f"{salvage.path}: chunks at bytes {sorted(wanted)} are gone since it was looked at")
    return target


def _rows(found: Sequence[ChunkMessage], channels: Mapping[int, ChannelKey]) -> PackedRows:
    used = tuple(dict.fromkeys(channels[message.channel_id] for message in found))
    number_of = {key: number for number, key in enumerate(used)}
    return PackedRows(
        used,
        np.array([number_of[channels[message.channel_id]] for message in found], dtype=np.int64),
        np.array([message.mcap_sequence for message in found], dtype=np.int64),
        np.array([message.log_time_ns for message in found], dtype=np.int64),
        [message.payload for message in found],
    )
