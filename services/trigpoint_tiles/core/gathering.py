"""One sweep's points onto the grid's cells, in one pass."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trigpoint.compiled import compiled
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
    INTENSITY_STEPS,
    LOW_COUNT,
    LOW_HIGHEST,
    LOW_INTENSITY,
    LOW_LAST,
    LOW_SWEEPS,
    MM,
    VARIANCE_MM2,
    ZERO_MM,
    Cells,
)
from trigpoint_tiles.core.grid import TILE_BITS, TILE_PX
from trigpoint_tiles.core.placement import PlacedSweep

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

GROUND_MOST_M, GROUND_SLOPE = 0.3, 0.01  # above the plane under the vehicle, and what a metre of range adds to it
HIGH_LEAST_M = 3.0  # what is higher does not move along streets: crowns of trees, roofs, signs over the road
HEIGHT_MOST_M = 900.0
VARIANCE_MOST_M2 = 1e4
INTENSITY_MOST = 1e6

NOWHERE, LEFT_OUT = -1, -2  # in place of a tile's slot: no cells yet; not wanted
USED, UNUSABLE, TOO_FAR, WEST, NORTH, EAST, SOUTH, ASKED_COLUMN, ASKED_ROW = range(9)  # of a tally
TILE_MASK = TILE_PX - 1
BLOCK = 256  # points placed before any is added to its cell: their cells fit the processor's nearest memory
FAR = 1 << 40  # cells away: nothing was hit


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """Where points are gathered: `pool` (slots, 256, 256, FIELDS) cells of tiles.

    `slot` (rows, columns) says for the tiles from (`row`, `column`) on which of the pool's are theirs, NOWHERE or
    LEFT_OUT; points outside are left out. `tally` (9,) counts the points USED, UNUSABLE (not a number) and TOO_FAR (or
    too near), and has the outermost WEST, NORTH, EAST and SOUTH cells hit, the last two less than the first where none,
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


class _Points(NamedTuple):
    """A sweep's arrays as PointsScanned has them, and what is added to each place in cells: (n, 2), or (0, 2)."""

    point_m: NDArray[np.float32]
    intensity: NDArray[np.float32]
    offset_ns: NDArray[np.int32]
    bend_px: Floats


class _Way(NamedTuple):
    """A SweepTable, and between which squared ranges points count."""

    first_ns: int
    step_ns: float
    to_plane: Floats
    to_height: Floats
    variance: Floats
    nearest_m2: float
    farthest_m2: float


class _Place(NamedTuple):
    """Where a point fell: its cell's column and row on the grid, height and squared range."""

    column: int
    row: int
    height_m: float
    range_m2: float


class _Seen(NamedTuple):
    """What a point tells its cell, as the cell counts it."""

    height_mm: int
    strength: int
    variance_mm2: int
    is_ground: bool
    is_high: bool


def gather(
    sweep: PointsScanned, placed: PlacedSweep, target: Target, *, number: int, limits: RangeLimits, begin: int = 0
) -> int:
    """How many points were dealt with: all, or up to one whose tile has no cells yet.

    The target's cells and tally are added to; `number`, from 1, tells this sweep from others in the same cells.
    """
    table = placed.table
    points = _Points(sweep.point_m, sweep.intensity, sweep.offset_ns, placed.bend_px)
    squared_m2 = (limits.least_m**2, limits.most_m**2)
    way = _Way(table.first_ns, table.step_ns, table.to_plane, table.to_height, table.variance, *squared_m2)
    window = (target.column, target.row, target.slot)
    return int(_gather(points, way, window, target.pool.reshape(-1), target.tally, (number, begin)))


@compiled
def _gather(
    points: _Points, way: _Way, window: tuple[int, int, Ints], cells: Cells, tally: Ints, run: tuple[int, int]
) -> int:
    number, at = run
    index, seen = np.empty(BLOCK, dtype=np.int64), np.empty((BLOCK, 5), dtype=np.int64)
    while at < len(points.intensity):
        end, placed = _place_block(points, way, window, tally, at, (index, seen))
        tally[UNUSABLE] += _fetch(cells, index, seen, placed)  # adds nothing: a count is never negative
        for one in range(placed):
            told = _Seen(seen[one, 0], seen[one, 1], seen[one, 2], seen[one, 3] != 0, seen[one, 4] != 0)
            _add(cells, index[one], told, number)
        if end < min(at + BLOCK, len(points.intensity)):
            return end
        at = end
    return at


@compiled
def _place_block(
    points: _Points, way: _Way, window: tuple[int, int, Ints], tally: Ints, begin: int, block: tuple[Ints, Ints]
) -> tuple[int, int]:
    """Where the points from `begin` on fall, up to one without cells: the first not placed, and how many were."""
    index, seen = block
    matrix, placed = np.empty((2, 4)), 0
    for at in range(begin, min(begin + BLOCK, len(points.intensity))):
        if at == begin or points.offset_ns[at] != points.offset_ns[at - 1]:
            _take_matrix(way, points.offset_ns[at], matrix)
        place = _placed(points, way, matrix, at)
        if not (math.isfinite(place.range_m2) and math.isfinite(points.intensity[at])):
            tally[UNUSABLE] += 1
            continue
        if not way.nearest_m2 <= place.range_m2 <= way.farthest_m2 or abs(place.height_m) > HEIGHT_MOST_M:
            tally[TOO_FAR] += 1
            continue
        slot = _slot(window, place)
        if slot == NOWHERE:
            tally[ASKED_COLUMN] = (place.column >> TILE_BITS) - window[0]
            tally[ASKED_ROW] = (place.row >> TILE_BITS) - window[1]
            return at, placed
        _count(tally, place)
        if slot >= 0:
            inside = ((place.row & TILE_MASK) << TILE_BITS) | (place.column & TILE_MASK)
            index[placed] = ((slot << (2 * TILE_BITS)) | inside) * FIELDS
            _keep(seen, placed, _seen(points, way, place, at))
            placed += 1
    return min(begin + BLOCK, len(points.intensity)), placed


@compiled
def _fetch(cells: Cells, index: Ints, seen: Ints, count: int) -> bool:
    """Reads cells that are about to be added to, many at once, so that memory's delay is met once for all of them."""
    impossible = False
    for one in range(count):
        impossible |= (cells[index[one]] | cells[index[one] + (1 - seen[one, 3]) * (FIELDS // 2)]) < 0
    return impossible


@compiled
def _count(tally: Ints, place: _Place) -> None:
    tally[USED] += 1
    tally[WEST], tally[NORTH] = min(tally[WEST], place.column), min(tally[NORTH], place.row)
    tally[EAST], tally[SOUTH] = max(tally[EAST], place.column), max(tally[SOUTH], place.row)


@compiled
def _keep(rows: Ints, at: int, seen: _Seen) -> None:
    rows[at, 0], rows[at, 1], rows[at, 2] = seen.height_mm, seen.strength, seen.variance_mm2
    rows[at, 3], rows[at, 4] = seen.is_ground, seen.is_high


@compiled
def _take_matrix(way: _Way, offset_ns: int, matrix: Floats) -> None:
    """The table's entry at a time, between the two nearest."""
    step = (offset_ns - way.first_ns) / way.step_ns
    entry = min(max(int(step), 0), way.to_plane.shape[0] - 2)
    share = step - entry
    for axis in range(2):
        for term in range(4):
            before, after = way.to_plane[entry, axis, term], way.to_plane[entry + 1, axis, term]
            matrix[axis, term] = before + share * (after - before)


@compiled
def _placed(points: _Points, way: _Way, matrix: Floats, at: int) -> _Place:
    x, y, z = float(points.point_m[at, 0]), float(points.point_m[at, 1]), float(points.point_m[at, 2])
    across = matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3]
    down = matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3]
    if len(points.bend_px) > 0:
        across, down = across + points.bend_px[at, 0], down + points.bend_px[at, 1]
    height_m = way.to_height[0] * x + way.to_height[1] * y + way.to_height[2] * z + way.to_height[3]
    return _Place(int(math.floor(across)), int(math.floor(down)), height_m, x * x + y * y + z * z)


@compiled
def _slot(window: tuple[int, int, Ints], place: _Place) -> int:
    """Which cells a place belongs to: a slot, NOWHERE or LEFT_OUT."""
    first_column, first_row, slots = window
    column, row = (place.column >> TILE_BITS) - first_column, (place.row >> TILE_BITS) - first_row
    if column < 0 or row < 0 or row >= slots.shape[0] or column >= slots.shape[1]:
        return LEFT_OUT
    return int(slots[row, column])


@compiled
def _seen(points: _Points, way: _Way, place: _Place, at: int) -> _Seen:
    strength = min(max(points.intensity[at], 0.0), INTENSITY_MOST) * INTENSITY_STEPS
    variance_m2 = min(way.variance[0] + place.range_m2 * way.variance[1], VARIANCE_MOST_M2)
    ground_m = GROUND_MOST_M + GROUND_SLOPE * math.sqrt(place.range_m2)
    height_mm = int(math.floor(place.height_m * MM + 0.5))
    is_ground, is_high = place.height_m <= ground_m, place.height_m >= HIGH_LEAST_M
    return _Seen(height_mm, int(strength + 0.5), int(variance_m2 * MM * MM + 0.5), is_ground, is_high)


@compiled
def _add(cells: Cells, at: int, seen: _Seen, number: int) -> None:
    """Adds a point to the cell that begins at `at` in all cells (k,). No branch waits for what a cell holds."""
    cells[at + VARIANCE_MM2] += seen.variance_mm2
    if seen.is_ground:
        cells[at + GROUND_COUNT] += 1
        cells[at + GROUND_INTENSITY] += seen.strength
        cells[at + GROUND_HEIGHT_MM] += seen.height_mm
        cells[at + GROUND_LOWEST] = max(cells[at + GROUND_LOWEST], ZERO_MM - seen.height_mm)
        first = (cells[at + GROUND_LAST] != number) & (cells[at + LOW_LAST] != number)
        cells[at + GROUND_SWEEPS] += first
        cells[at + GROUND_LAST] = number if first else cells[at + GROUND_LAST]
        return
    cells[at + ABOVE_HEIGHT_MM] += seen.height_mm
    if seen.is_high:
        cells[at + HIGH_COUNT] += 1
        cells[at + HIGH_INTENSITY] += seen.strength
        cells[at + HIGH_HIGHEST] = max(cells[at + HIGH_HIGHEST], ZERO_MM + seen.height_mm)
        return
    cells[at + LOW_COUNT] += 1
    cells[at + LOW_INTENSITY] += seen.strength
    cells[at + LOW_HIGHEST] = max(cells[at + LOW_HIGHEST], ZERO_MM + seen.height_mm)
    first = cells[at + LOW_LAST] != number
    cells[at + LOW_SWEEPS] += first
    cells[at + LOW_LAST] = number
    cells[at + GROUND_SWEEPS] -= first & (cells[at + GROUND_LAST] == number)
