"""Chunks out of a file that others may take away meanwhile."""

from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Chunk

from trigpoint.errors import LogDamaged
from trigpoint.logs.catalog import CatalogChunk
from trigpoint.logs.chunks import FRAME, parsed, unpacked


def opened(path: Path, chunks: Sequence[CatalogChunk]) -> BinaryIO:
    """The file, to be read. Raises LogDamaged where it is gone."""
    try:
        return path.open("rb")
    except FileNotFoundError as error:
        raise taken_away(path, chunks) from error


def taken_away(path: Path, chunks: Sequence[CatalogChunk]) -> LogDamaged:
    """What is raised for chunks whose file is gone since they were looked up."""
    span = f"numbers {chunks[0].number} to {chunks[-1].number + chunks[-1].count - 1}"
    return LogDamaged(f"{path}: {span} were taken away while the stream was read")


def chunk_data(file: BinaryIO, path: Path, chunk: CatalogChunk) -> bytes:
    """The records of a chunk, checked. Raises LogDamaged."""
    file.seek(chunk.offset)
    record = file.read(chunk.length)
    try:
        if len(record) < chunk.length or FRAME.unpack_from(record) != (Opcode.CHUNK, chunk.length - FRAME.size):
            raise LogDamaged(f"no chunk of {chunk.length} bytes")
        return unpacked(parsed(Chunk, record[FRAME.size :]), checksum_required=True)
    except LogDamaged as error:
        raise LogDamaged(f"{path}, byte {chunk.offset}: {error}; {chunk.count} messages lost") from error
