"""A tile's cells as bytes: those that saw something, compressed."""

import struct

import numpy as np
import zstandard
from numpy.typing import NDArray

from trigpoint.compiled import compiled
from trigpoint.errors import InputError
from trigpoint_tiles.core.cells import (
    EXTREMES,
    FIELDS,
    GROUND_COUNT,
    HIGH_COUNT,
    LOW_COUNT,
    WHILE_GATHERING,
    Cells,
)
from trigpoint_tiles.core.grid import TILE_PX
from trigpoint_tiles.core.rendering import BANDS, Bands

Ints = NDArray[np.int64]

MAGIC = b"TPTILE2\n"
LEVEL = 1  # a fast one: parts are read again twice
KEPT = np.array([field for field in range(FIELDS) if field not in WHILE_GATHERING], dtype=np.int64)
IS_EXTREME = np.isin(KEPT, EXTREMES)
HEADER = struct.Struct(f"<8sI{len(KEPT)}B")  # how many cells, and of how many bytes the numbers of each field are
WIDTHS = {width: np.dtype(f"<i{width}") for width in (1, 2, 4, 8)}
CELLS = TILE_PX * TILE_PX


def part_bytes(cells: Cells) -> bytes:
    """The cells (256, 256, FIELDS) of a tile as bytes."""
    index, columns = np.empty(CELLS, dtype=np.uint16), np.empty((len(KEPT), CELLS), dtype=np.int64)
    count = _take_columns(cells.reshape(-1), KEPT, index, columns)
    columns = columns[:, :count]
    widths = [_width(column) for column in columns]
    packed = [column.astype(WIDTHS[width]).tobytes() for column, width in zip(columns, widths, strict=True)]
    step = np.diff(index[:count], prepend=np.uint16(0)).astype("<u2")  # mostly 1
    body = step.tobytes() + b"".join(packed)
    compressor = zstandard.ZstdCompressor(level=LEVEL, write_checksum=True)
    return HEADER.pack(MAGIC, count, *widths) + compressor.compress(body)


def merge_part(total: Cells, content: bytes) -> None:
    """Adds a part to the cells (256, 256, FIELDS) of its tile, in place. Raises InputError where the bytes are not one,
    or damaged."""
    try:
        magic, count, *widths = HEADER.unpack_from(content)
        if magic != MAGIC or count > CELLS or not WIDTHS.keys() >= set(widths):
            raise InputError(f"a part begins with {content[:12]!r}: {MAGIC!r} and at most {CELLS} cells are needed")
        size = count * (2 + sum(widths))
        body = zstandard.ZstdDecompressor().decompress(content[HEADER.size :], max_output_size=size)
        index = np.cumsum(np.frombuffer(body, dtype="<u2", count=count), dtype=np.int64)
        columns, begin = np.empty((len(KEPT), count), dtype=np.int64), 2 * count
        for column, width in zip(columns, widths, strict=True):
            column[:] = np.frombuffer(body, dtype=WIDTHS[width], count=count, offset=begin)
            begin += count * width
    except (struct.error, ValueError, zstandard.ZstdError) as error:
        raise InputError(f"a part of {len(content)} bytes is damaged: {error}") from error
    if count and index[-1] >= CELLS:
        raise InputError(f"a part of {len(content)} bytes is damaged: it names cell {index[-1]} of {CELLS}")
    _merge_columns(total.reshape(-1), index, columns, KEPT, IS_EXTREME)


def _width(column: Ints) -> int:
    """The fewest bytes that hold every number."""
    least, most = int(column.min(initial=0)), int(column.max(initial=0))
    return next(width for width, form in WIDTHS.items() if np.iinfo(form).min <= least and most <= np.iinfo(form).max)


@compiled
def _take_columns(cells: Cells, kept: Ints, index: NDArray[np.uint16], columns: Ints) -> int:
    """How many cells saw something; which, and the kept fields of each."""
    count = 0
    for cell in range(len(cells) // FIELDS):
        at = cell * FIELDS
        if cells[at + GROUND_COUNT] | cells[at + LOW_COUNT] | cells[at + HIGH_COUNT]:
            index[count] = cell
            for row in range(len(kept)):
                columns[row, count] = cells[at + kept[row]]
            count += 1
    return count


@compiled
def _merge_columns(cells: Cells, index: Ints, columns: Ints, kept: Ints, is_extreme: NDArray[np.bool_]) -> None:
    for one in range(len(index)):
        at = index[one] * FIELDS
        for row in range(len(kept)):
            before, more = cells[at + kept[row]], columns[row, one]
            cells[at + kept[row]] = max(before, more) if is_extreme[row] else before + more


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
