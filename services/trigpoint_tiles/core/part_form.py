"""A tile's cells as bytes: those that saw something, compressed."""

import struct

import numpy as np
import zstandard

from trigpoint.errors import InputError
from trigpoint_tiles.core.cells import FIELDS, GROUND_COUNT, HIGH_COUNT, LOW_COUNT, WHILE_GATHERING, Cells
from trigpoint_tiles.core.grid import TILE_PX
from trigpoint_tiles.core.rendering import BANDS, Bands

MAGIC = b"TPTILE1\n"
HEADER = struct.Struct("<8sI")
LEVEL = 1  # a fast one: parts are read again once
KEPT = np.array([field for field in range(FIELDS) if field not in WHILE_GATHERING], dtype=np.int64)
CELLS = TILE_PX * TILE_PX


def part_bytes(cells: Cells) -> bytes:
    """The cells (256, 256, FIELDS) of a tile as bytes."""
    flat = cells.reshape(CELLS, FIELDS)
    (index,) = np.nonzero(flat[:, GROUND_COUNT] | flat[:, LOW_COUNT] | flat[:, HIGH_COUNT])
    columns = np.ascontiguousarray(flat[np.ix_(index, KEPT)].T).astype("<i8")
    body = index.astype("<u4").tobytes() + columns.tobytes()
    return HEADER.pack(MAGIC, len(index)) + zstandard.ZstdCompressor(level=LEVEL, write_checksum=True).compress(body)


def bands_bytes(bands: Bands) -> bytes:
    """A tile's bands (5, 256, 256) as bytes."""
    content = np.ascontiguousarray(bands, dtype="<f4").tobytes()
    return zstandard.ZstdCompressor(level=LEVEL, write_checksum=True).compress(content)


def bands_from(content: bytes) -> Bands:
    """The bands (5, 256, 256) of a tile. Raises InputError where the bytes are none, or damaged."""
    try:
        body = zstandard.ZstdDecompressor().decompress(content, max_output_size=len(BANDS) * CELLS * 4)
        return np.frombuffer(body, dtype="<f4").reshape(len(BANDS), TILE_PX, TILE_PX)
    except (ValueError, zstandard.ZstdError) as error:
        raise InputError(f"a tile's bands of {len(content)} bytes are damaged: {error}") from error


def cells_from(content: bytes) -> Cells:
    """The cells (256, 256, FIELDS) of a part. Raises InputError where the bytes are not one, or damaged."""
    try:
        magic, count = HEADER.unpack_from(content)
        size = count * (4 + 8 * len(KEPT))
        if magic != MAGIC or count > CELLS:
            raise InputError(f"a part begins with {content[:12]!r}: {MAGIC!r} and at most {CELLS} cells are needed")
        body = zstandard.ZstdDecompressor().decompress(content[HEADER.size :], max_output_size=size)
    except (struct.error, zstandard.ZstdError) as error:
        raise InputError(f"a part of {len(content)} bytes is damaged: {error}") from error
    index = np.frombuffer(body, dtype="<u4", count=count)
    columns = np.frombuffer(body, dtype="<i8", offset=4 * count).reshape(len(KEPT), count)
    cells = np.zeros((CELLS, FIELDS), dtype=np.int64)
    cells[np.ix_(index, KEPT)] = columns.T
    return cells.reshape(TILE_PX, TILE_PX, FIELDS)
