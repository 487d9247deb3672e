"""One sweep's points onto the grid's cells, in one pass."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.compiled import compiled, fetch_soon
from trigpoint.events.scanned import PointsScanned
from trigpoint_tiles.core.cells import (
    ABOVE_HEIGHT_MM,
    FIELDS,
    GROUND_COUNT,
    GROUND_HEIGHT_MM,
    GROUND_INTENSITY,
    GROUND_LAST,
    GROUND_LOWEST,
    GROUND_SWEEPS,
    HIGH_COUNT,
    HIGH_HIGHEST,
    HIGH_INTENSITY,
    LOW_COUNT,
    LOW_HIGHEST,
    LOW_INTENSITY,
    LOW_LAST,
    LOW_SWEEPS,
    VARIANCE_MM2,
    ZERO_MM,
    Cells,
)
from trigpoint_tiles.core.grid import TILE_BITS, TILE_PX
from trigpoint_tiles.core.placement import PlacedSweep
from trigpoint_tiles.core.point_blocks import (
    BLOCK,
    GROUND,
    HIGH,
    NO_NUMBER,
    OUT_OF_REACH,
    Block,
    Points,
    Way,
    empty_block,
    place_block,
)

Ints = NDArray[np.int64]

NOWHERE, LEFT_OUT = -1, -2  # in place of a tile's slot: no cells yet; not wanted
USED, UNUSABLE, TOO_FAR, WEST, NORTH, EAST, SOUTH, ASKED_COLUMN, ASKED_ROW = range(9)  # of a tally
TILE_MASK = TILE_PX - 1
FAR = 1 << 40  # cells away: nothing was hit


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """Where points are gathered: `pool` (slots, 256, 256, FIELDS) cells of tiles.

    `slot` (rows, columns) says for the tiles from (`row`, `column`) on which of the pool's are theirs, NOWHERE or
    LEFT_OUT. `tally` (9,) counts the points USED, UNUSABLE (not a number) and TOO_FAR (or too near, or outside these
    tiles), and has the outermost WEST, NORTH, EAST and SOUTH cells hit, the last two less than the first where none,
    and the tile a point fell on that has no cells yet, counted from (`row`, `column`).
    """

    column: int
    row: int
    slot: Ints
    pool: Cells
    tally: Ints


def no_tally() -> Ints:
    """A tally (9,) of nothing yet."""
    return np.array([0, 0, 0, FAR, FAR, -FAR, -FAR, 0, 0], dtype=np.int64)


@dataclass(frozen=True, slots=True, kw_only=True)
class RangeLimits:
    """Points nearer than `least_m` are the vehicle itself, farther than `most_m` too uncertain."""

    least_m: float = 1.5
    most_m: float = 60.0


def gather(
    sweep: PointsScanned, placed: PlacedSweep, target: Target, *, number: int, limits: RangeLimits, begin: int = 0
) -> int:
    """How many points were dealt with: all, or up to one whose tile has no cells yet.

    The target's cells and tally are added to; `number`, from 1, tells this sweep from others in the same cells.
    """
    points = Points(sweep.point_m.reshape(-1), sweep.intensity, sweep.offset_ns, placed.bend_px.reshape(-1))
    window = (target.column << TILE_BITS, target.row << TILE_BITS, target.slot)
    way = _way(placed, target, limits)
    return int(_gather(points, way, window, target.pool.reshape(-1), target.tally, (number, begin)))


def _way(placed: PlacedSweep, target: Target, limits: RangeLimits) -> Way:
    table, (rows, columns) = placed.table, target.slot.shape
    to_plane = table.to_plane.copy()
    to_plane[:, :, 3] -= (target.column << TILE_BITS, target.row << TILE_BITS)
    return Way(
        table.first_ns,
        1.0 / table.step_ns,
        to_plane,
        table.to_height,
        table.variance,
        limits.least_m**2,
        limits.most_m**2,
        float(columns << TILE_BITS),
        float(rows << TILE_BITS),
    )


@compiled
def _gather(
    points: Points, way: Way, window: tuple[int, int, Ints], cells: Cells, tally: Ints, run: tuple[int, int]
) -> int:
    number, at = run
    block, index, which = empty_block(), np.empty(BLOCK, dtype=np.int64), np.empty(BLOCK, dtype=np.int64)
    while at < len(points.intensity):
        count = place_block(points, way, at, block)
        known, placed = _find_cells(block, count, window[2], cells, (index, which))
        _count(block, known, window, tally)
        _add_all(cells, (index[:placed], which[:placed]), block, number)
        at += known
        if known < count:
            tally[ASKED_COLUMN], tally[ASKED_ROW] = block.column[known] >> TILE_BITS, block.row[known] >> TILE_BITS
            return at
    return at


@compiled
def _find_cells(block: Block, count: int, slots: Ints, cells: Cells, where: tuple[Ints, Ints]) -> tuple[int, int]:
    """How many points of the block come before one whose tile has no cells yet, and how many of them have cells: of
    each where those begin in all cells, and which it is. Memory's delay is met once for all of them."""
    index, which = where
    placed, whats, columns, rows = 0, block.what, block.column, block.row
    for one in range(count):
        column, row, what = columns[one], rows[one], whats[one]
        slot = slots[row >> TILE_BITS, column >> TILE_BITS]
        is_used = what < OUT_OF_REACH
        if slot == NOWHERE and is_used:
            return one, placed
        at = ((max(slot, 0) << (2 * TILE_BITS)) | ((row & TILE_MASK) << TILE_BITS) | (column & TILE_MASK)) * FIELDS
        fetch_soon(cells, at)
        fetch_soon(cells, at + (what != GROUND) * (FIELDS // 2))
        index[placed], which[placed] = at, one
        placed += is_used & (slot >= 0)
    return count, placed


@compiled
def _count(block: Block, count: int, window: tuple[int, int, Ints], tally: Ints) -> None:
    """Adds to the tally what became of the block's first points."""
    used, unusable, west, north, east, south = 0, 0, FAR, FAR, -FAR, -FAR
    for one in range(count):
        what, column, row = block.what[one], block.column[one], block.row[one]
        is_used = what < OUT_OF_REACH
        used, unusable = used + is_used, unusable + (what == NO_NUMBER)
        west, north = min(west, column if is_used else FAR), min(north, row if is_used else FAR)
        east, south = max(east, column if is_used else -FAR), max(south, row if is_used else -FAR)
    tally[USED] += used
    tally[UNUSABLE] += unusable
    tally[TOO_FAR] += count - used - unusable
    tally[WEST], tally[NORTH] = min(tally[WEST], west + window[0]), min(tally[NORTH], north + window[1])
    tally[EAST], tally[SOUTH] = max(tally[EAST], east + window[0]), max(tally[SOUTH], south + window[1])


@compiled
def _add_all(cells: Cells, where: tuple[Ints, Ints], block: Block, number: int) -> None:
    index, which = where
    what, height_mm, strength, variance_mm2 = block.what, block.height_mm, block.strength, block.variance_mm2
    for placed in range(len(index)):
        at, one = index[placed], which[placed]
        cells[at + VARIANCE_MM2] += np.int64(variance_mm2[one])
        _add(cells, at, what[one], height_mm[one], strength[one], number)


@compiled
def _add(cells: Cells, at: int, what: int, height_mm: int, strength: int, number: int) -> None:
    """Adds a point to the cell that begins at `at` in all cells (k,). No branch waits for what a cell holds."""
    if what == GROUND:
        cells[at + GROUND_COUNT] += 1
        cells[at + GROUND_INTENSITY] += strength
        cells[at + GROUND_HEIGHT_MM] += height_mm
        cells[at + GROUND_LOWEST] = max(cells[at + GROUND_LOWEST], ZERO_MM - height_mm)
        first = (cells[at + GROUND_LAST] != number) & (cells[at + LOW_LAST] != number)
        cells[at + GROUND_SWEEPS] += first
        cells[at + GROUND_LAST] = number if first else cells[at + GROUND_LAST]
        return
    cells[at + ABOVE_HEIGHT_MM] += height_mm
    if what == HIGH:
        cells[at + HIGH_COUNT] += 1
        cells[at + HIGH_INTENSITY] += strength
        cells[at + HIGH_HIGHEST] = max(cells[at + HIGH_HIGHEST], ZERO_MM + height_mm)
        return
    cells[at + LOW_COUNT] += 1
    cells[at + LOW_INTENSITY] += strength
    cells[at + LOW_HIGHEST] = max(cells[at + LOW_HIGHEST], ZERO_MM + height_mm)
    first = cells[at + LOW_LAST] != number
    cells[at + LOW_SWEEPS] += first
    cells[at + LOW_LAST] = number
    cells[at + GROUND_SWEEPS] -= first & (cells[at + GROUND_LAST] == number)
