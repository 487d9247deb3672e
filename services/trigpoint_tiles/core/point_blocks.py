"""Points of a sweep brought onto the cells of a window, a block at a time, by loops that processors vectorise.

Every loop is short and writes one or two arrays: that is what a compiler can prove free of overlaps.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trigpoint.compiled import compiled
from trigpoint_tiles.core.cells import INTENSITY_STEPS, MM

Floats = NDArray[np.float64]

BLOCK = 256  # points placed before any is added to its cell: their cells fit the processor's nearest memory

GROUND_MOST_M, GROUND_SLOPE = 0.3, 0.01  # above the plane under the vehicle, and what a metre of range adds to it
HIGH_LEAST_M = 3.0  # what is higher does not move along streets: crowns of trees, roofs, signs over the road
HEIGHT_MOST_M = 900.0
VARIANCE_MOST_M2 = 1e4
INTENSITY_MOST = 1e6

GROUND, LOW, HIGH, OUT_OF_REACH, NO_NUMBER = range(5)  # what a point is


class Points(NamedTuple):
    """A sweep's arrays: flat point_m (3 n,), intensity (n,), offset_ns (n,), and what is added to each place in cells:
    flat (2 n,), or (0,)."""

    point_m: NDArray[np.float32]
    intensity: NDArray[np.float32]
    offset_ns: NDArray[np.int32]
    bend_px: Floats


class Way(NamedTuple):
    """A SweepTable onto the cells of a window (columns, rows) counted from its corner; between which squared ranges
    points count."""

    first_ns: int
    steps_per_ns: float
    to_plane: Floats
    to_height: Floats
    variance: Floats
    nearest_m2: float
    farthest_m2: float
    columns: float
    rows: float


class Block(NamedTuple):
    """What is known of the points of a block, (BLOCK,) each: the table's entry and the share of the way to the next,
    column and row on the window with fractions, height over the ground, squared range, variance per axis in mm^2, what
    the point is, and as it is counted its height in mm, its intensity, its cell's column and row."""

    entry: NDArray[np.int32]
    share: Floats
    across: Floats
    down: Floats
    height_m: Floats
    range_m2: Floats
    variance_mm2: Floats
    what: NDArray[np.uint8]
    height_mm: NDArray[np.int32]
    strength: NDArray[np.int32]
    column: NDArray[np.int32]
    row: NDArray[np.int32]


@compiled
def empty_block() -> Block:
    """Room for a block."""
    return Block(
        np.empty(BLOCK, dtype=np.int32),
        np.empty(BLOCK),
        np.empty(BLOCK),
        np.empty(BLOCK),
        np.empty(BLOCK),
        np.empty(BLOCK),
        np.empty(BLOCK),
        np.empty(BLOCK, dtype=np.uint8),
        np.empty(BLOCK, dtype=np.int32),
        np.empty(BLOCK, dtype=np.int32),
        np.empty(BLOCK, dtype=np.int32),
        np.empty(BLOCK, dtype=np.int32),
    )


@compiled
def place_block(points: Points, way: Way, begin: int, block: Block) -> int:
    """How many points of the block that begins at one were placed: all there are, up to BLOCK."""
    count = min(BLOCK, len(points.intensity) - begin)
    point_m = points.point_m[3 * begin : 3 * (begin + count)]
    intensity = points.intensity[begin : begin + count]
    _find_entries(points.offset_ns[begin : begin + count], way, block.entry, block.share)
    _project(point_m, way, block)
    if len(points.bend_px) > 0:
        _bend(points.bend_px[2 * begin : 2 * (begin + count)], block.across, block.down)
    _measure(point_m, way.to_height, block.height_m, block.range_m2)
    _tell_apart(block.height_m[:count], block.range_m2, intensity, (way.nearest_m2, way.farthest_m2), block.what)
    _onto_cells(block.across[:count], way.columns, block.what, block.column)
    _onto_cells(block.down[:count], way.rows, block.what, block.row)
    _count_heights(block.height_m[:count], block.what, block.height_mm)
    _count_strengths(intensity, block.what, block.strength)
    _count_variances(block.range_m2[:count], way.variance, block.variance_mm2)
    return count


@compiled
def _find_entries(offset_ns: NDArray[np.int32], way: Way, entry: NDArray[np.int32], share: Floats) -> None:
    last = float(way.to_plane.shape[0] - 2)
    for one in range(len(offset_ns)):
        step = (offset_ns[one] - way.first_ns) * way.steps_per_ns
        whole = math.floor(step if step < last else last)
        whole = whole if whole > 0.0 else 0.0
        entry[one] = np.int32(whole)
        share[one] = step - whole


@compiled
def _project(point_m: NDArray[np.float32], way: Way, block: Block) -> None:
    """Column and row on the window by the table, for runs of points between the same two of its entries."""
    count, begin = len(point_m) // 3, 0
    while begin < count:
        entry, end = block.entry[begin], begin + 1
        while end < count and block.entry[end] == entry:
            end += 1
        run, share = point_m[3 * begin : 3 * end], block.share[begin:end]
        _along(run, way.to_plane[entry, 0], way.to_plane[entry + 1, 0], share, block.across[begin:end])
        _along(run, way.to_plane[entry, 1], way.to_plane[entry + 1, 1], share, block.down[begin:end])
        begin = end


@compiled
def _along(point_m: NDArray[np.float32], before: Floats, after: Floats, share: Floats, found: Floats) -> None:
    """One coordinate of points, between what two rows (4,) of the table say."""
    a, b, c, d = before[0], before[1], before[2], before[3]
    e, f, g, h = after[0] - a, after[1] - b, after[2] - c, after[3] - d
    for one in range(len(found)):
        x, y, z = float(point_m[3 * one]), float(point_m[3 * one + 1]), float(point_m[3 * one + 2])
        found[one] = (a * x + b * y + c * z + d) + share[one] * (e * x + f * y + g * z + h)


@compiled
def _bend(bend_px: Floats, across: Floats, down: Floats) -> None:
    for one in range(len(bend_px) // 2):
        across[one] += bend_px[2 * one]
        down[one] += bend_px[2 * one + 1]


@compiled
def _measure(point_m: NDArray[np.float32], to_height: Floats, height_m: Floats, range_m2: Floats) -> None:
    a, b, c, d = to_height[0], to_height[1], to_height[2], to_height[3]
    for one in range(len(point_m) // 3):
        x, y, z = float(point_m[3 * one]), float(point_m[3 * one + 1]), float(point_m[3 * one + 2])
        height_m[one] = a * x + b * y + c * z + d
        range_m2[one] = x * x + y * y + z * z


@compiled
def _tell_apart(
    height_m: Floats,
    range_m2: Floats,
    intensity: NDArray[np.float32],
    squared_m2: tuple[float, float],
    what: NDArray[np.uint8],
) -> None:
    nearest_m2, farthest_m2 = squared_m2
    for one in range(len(height_m)):
        high_m, far_m2 = height_m[one], range_m2[one]
        total = far_m2 + float(intensity[one])
        above = LOW if high_m < HIGH_LEAST_M else HIGH
        kind = GROUND if high_m <= GROUND_MOST_M + GROUND_SLOPE * math.sqrt(far_m2) else above
        within = (far_m2 >= nearest_m2) & (far_m2 <= farthest_m2) & (abs(high_m) <= HEIGHT_MOST_M)
        kind = kind if within else OUT_OF_REACH
        what[one] = np.uint8(kind if total - total == 0.0 else NO_NUMBER)


@compiled
def _onto_cells(place: Floats, size: float, what: NDArray[np.uint8], cell: NDArray[np.int32]) -> None:
    for one in range(len(place)):
        at = place[one]
        is_inside = (at >= 0.0) & (at < size)
        cell[one] = np.int32(at if is_inside else 0.0)
        outside = np.uint8(max(what[one], OUT_OF_REACH))
        what[one] = what[one] if is_inside else outside


@compiled
def _count_heights(height_m: Floats, what: NDArray[np.uint8], height_mm: NDArray[np.int32]) -> None:
    for one in range(len(height_m)):
        height_mm[one] = np.int32(math.floor(height_m[one] * MM + 0.5) if what[one] < OUT_OF_REACH else 0.0)


@compiled
def _count_strengths(intensity: NDArray[np.float32], what: NDArray[np.uint8], strength: NDArray[np.int32]) -> None:
    for one in range(len(intensity)):
        bright = float(intensity[one])
        bright = bright if bright < INTENSITY_MOST else INTENSITY_MOST
        bright = bright if bright > 0.0 else 0.0
        strength[one] = np.int32(bright * INTENSITY_STEPS + 0.5 if what[one] < OUT_OF_REACH else 0.0)


@compiled
def _count_variances(range_m2: Floats, variance: Floats, variance_mm2: Floats) -> None:
    fixed, per_m2 = variance[0], variance[1]
    for one in range(len(range_m2)):
        told_m2 = fixed + range_m2[one] * per_m2
        told_m2 = told_m2 if told_m2 < VARIANCE_MOST_M2 else VARIANCE_MOST_M2
        variance_mm2[one] = told_m2 * MM * MM + 0.5
