"""Walls of one sweep as straight lines in plan: split ring by ring, merged over the rings."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.compiled import compiled
from trigpoint_perception.core.segments import OrderedSweep
from trigpoint_perception.settings import WallSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Line = tuple[float, float, float, float, float]

MERGE_ANGLE_RAD = 0.09  # 5 degrees
MERGE_OFFSET_M = 0.15
MERGE_GAP_M = 0.6
PIECE_SHARE = 0.4  # of a wall's least length, for one ring's piece of it
RANGE_SIGMA_M = 0.03
SHARED_POINTS = 6.0  # neighbours' errors go together: so many points tell as much as one
FROM_M = 0.3  # above the ground
SUMS = 9  # n, x, y, xx, xy, yy, top, lowest ring, highest ring


@dataclass(frozen=True, slots=True, kw_only=True)
class Walls:
    """Walls (m,): middle_m (m, 2) and unit direction (m, 2) in the base frame, begin and end along it (m,) from the
    middle; 1-sigma of the offset across (m,) in m and of the direction (m,) in rad; top above the ground, points."""

    middle_m: Floats
    direction: Floats
    begin_m: Floats
    end_m: Floats
    offset_sigma_m: Floats
    direction_sigma_rad: Floats
    top_m: Floats
    points: Ints


def walls_of(ordered: OrderedSweep, sensor_m: Floats, settings: WallSettings) -> Walls:
    """The walls of a sweep: straight, upright, higher than cars.

    Points of cells in plan that hold points from low to high are taken ring by ring, chained, split where they leave
    the chord (Douglas and Peucker 1973, as iterative end-point fit), fitted by least squares, and pieces on one line
    are merged, the longest first.
    """
    upright = _upright(ordered, sensor_m, settings)
    seen = _chosen(upright, ordered.point_m, ordered.height_m, ordered.ring, ordered.run_m)
    length_min_m = PIECE_SHARE * settings.length_min_m
    limits = np.array([settings.gap_m, settings.split_m, settings.sigma_max_m, length_min_m, settings.points_min])
    sums, extent = _pieces(seen, ordered.step_rad, limits)
    longest_first = np.argsort(-(extent[:, 1] - extent[:, 0]), kind="stable")
    merged = _merged(sums[longest_first], extent[longest_first])
    return _kept(*merged, settings)


def _upright(ordered: OrderedSweep, sensor_m: Floats, settings: WallSettings) -> Bools:
    """Which points (n,) stand in a cell that is filled from low to high."""
    side = int(2.0 * settings.range_max_m / settings.cell_m) + 1
    corner_m = sensor_m[:2] - settings.range_max_m
    cell = _cells(ordered.point_m, ordered.height_m, corner_m, settings.cell_m, side)
    return _filled(cell, ordered.height_m, side * side, settings.top_min_m, settings.extent_min_m)


def _kept(sums: Floats, extent: Floats, settings: WallSettings) -> Walls:
    middle_m, direction, sigma_m = _fitted(sums)
    length_m = extent[:, 1] - extent[:, 0]
    rings = (sums[:, 8] - sums[:, 7] + 1.0).astype(np.int64)
    kept = (length_m >= settings.length_min_m) & (sigma_m <= settings.sigma_max_m) & (sums[:, 6] >= settings.top_min_m)
    kept &= rings > 1
    independent = np.maximum(sums[:, 0] / SHARED_POINTS, 1.0)
    sigma_m = np.maximum(sigma_m, RANGE_SIGMA_M) / np.sqrt(independent)
    return Walls(
        middle_m=middle_m[kept],
        direction=direction[kept],
        begin_m=extent[kept, 0],
        end_m=extent[kept, 1],
        offset_sigma_m=sigma_m[kept],
        direction_sigma_rad=(sigma_m * np.sqrt(12.0) / np.maximum(length_m, 1e-9))[kept],
        top_m=sums[kept, 6],
        points=sums[kept, 0].astype(np.int64),
    )


def _fitted(sums: Floats) -> tuple[Floats, Floats, Floats]:
    """Middles (m, 2), directions (m, 2) and root mean square distances (m,) from the lines of sums (m, 9)."""
    line = _lines(sums)
    return line[:, 0:2], line[:, 2:4], line[:, 4]


@compiled
def _cells(point_m: Floats, height_m: Floats, corner_m: Floats, cell_m: float, side: int) -> Ints:
    """The cell (n,) of each point in a square grid, -1 for what is near the ground or outside."""
    cell = np.full(len(point_m), -1, np.int64)
    for row in range(len(point_m)):
        column, line = (point_m[row, 0] - corner_m[0]) / cell_m, (point_m[row, 1] - corner_m[1]) / cell_m
        if height_m[row] > FROM_M and 0.0 <= column < side and 0.0 <= line < side:
            cell[row] = int(column) * side + int(line)
    return cell


@compiled
def _filled(cell: Ints, height_m: Floats, cells: int, top_min_m: float, extent_min_m: float) -> Bools:
    low, high = np.full(cells, np.float32(np.inf)), np.full(cells, np.float32(-np.inf))
    for row in range(len(cell)):
        if cell[row] >= 0:
            low[cell[row]] = min(low[cell[row]], height_m[row])
            high[cell[row]] = max(high[cell[row]], height_m[row])
    filled = np.zeros(len(cell), np.bool_)
    for row in range(len(cell)):
        if cell[row] >= 0:
            filled[row] = high[cell[row]] >= top_min_m and high[cell[row]] - low[cell[row]] >= extent_min_m
    return filled


@compiled
def _chosen(chosen: Bools, point_m: Floats, height_m: Floats, ring: Ints, run_m: Floats) -> Floats:
    """Of the chosen of points (n,): x, y, height, ring, run (m, 5)."""
    seen = np.empty((chosen.sum(), 5))
    found = 0
    for row in range(len(chosen)):
        if chosen[row]:
            seen[found, 0], seen[found, 1], seen[found, 2] = point_m[row, 0], point_m[row, 1], height_m[row]
            seen[found, 3], seen[found, 4] = ring[row], run_m[row]
            found += 1
    return seen


@compiled
def _line(sums: Floats) -> Line:
    """Middle x, y, direction x, y, and root mean square distance of the line of total least squares."""
    count = sums[0]
    x, y = sums[1] / count, sums[2] / count
    xx, xy, yy = sums[3] / count - x * x, sums[4] / count - x * y, sums[5] / count - y * y
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    smallest = 0.5 * (xx + yy) - np.hypot(0.5 * (xx - yy), xy)
    return x, y, np.cos(angle), np.sin(angle), np.sqrt(max(smallest, 0.0))


@compiled
def _lines(sums: Floats) -> Floats:
    """The lines (m, 5) of sums (m, 9)."""
    lines = np.empty((len(sums), 5))
    for row in range(len(sums)):
        lines[row, 0], lines[row, 1], lines[row, 2], lines[row, 3], lines[row, 4] = _line(sums[row])
    return lines


@compiled
def _pieces(seen: Floats, step_rad: float, limits: Floats) -> tuple[Floats, Floats]:
    """Sums (m, 9) and extents (m, 2) along their own lines of the straight pieces of all rings; seen (n, 5): x, y,
    height, ring, run; limits (5,): gap, split, sigma, length, points."""
    sums, extents = np.empty((len(seen), SUMS)), np.empty((len(seen), 2))
    found, begin = 0, 0
    while begin < len(seen):
        end = begin + 1
        while end < len(seen) and _are_chained(seen[end - 1], seen[end], step_rad, limits[0]):
            end += 1
        stack = [(begin, end)]
        while len(stack) > 0:
            low, high = stack.pop()
            if high - low < limits[4]:
                continue
            at, away = _farthest(seen[low:high])
            if away > limits[1]:
                stack.append((low, low + at))
                stack.append((low + at, high))
                continue
            total = _summed(seen[low:high])
            line = _line(total)
            least, most = _extent(seen[low:high], line)
            if most - least >= limits[3] and line[4] <= limits[2]:
                sums[found] = total
                extents[found, 0], extents[found, 1] = least, most
                found += 1
        begin = end
    return sums[:found], extents[:found]


@compiled
def _are_chained(before: Floats, here: Floats, step_rad: float, gap_m: float) -> bool:
    x, y = here[0] - before[0], here[1] - before[1]
    apart = np.sqrt(x * x + y * y)
    return bool(here[3] == before[3] and apart <= gap_m + 3.0 * step_rad * before[4])


@compiled
def _farthest(seen: Floats) -> tuple[int, float]:
    """The point farthest from the chord between the first and the last, and how far it is."""
    x, y = seen[0, 0], seen[0, 1]
    dx, dy = seen[-1, 0] - x, seen[-1, 1] - y
    length = max(np.hypot(dx, dy), 1e-9)
    at, away = 0, 0.0
    for number in range(1, len(seen) - 1):
        across = abs((seen[number, 1] - y) * dx - (seen[number, 0] - x) * dy) / length
        if across > away:
            at, away = number, across
    return at, away


@compiled
def _summed(seen: Floats) -> Floats:
    total = np.zeros(SUMS)
    for number in range(len(seen)):
        x, y = seen[number, 0], seen[number, 1]
        total[1] += x
        total[2] += y
        total[3] += x * x
        total[4] += x * y
        total[5] += y * y
        total[6] = max(total[6], seen[number, 2])
    total[0] = len(seen)
    total[7] = total[8] = seen[0, 3]
    return total


@compiled
def _extent(seen: Floats, line: Line) -> tuple[float, float]:
    """The least and the greatest place of the points along a line."""
    least, most = np.inf, -np.inf
    for number in range(len(seen)):
        along = (seen[number, 0] - line[0]) * line[2] + (seen[number, 1] - line[1]) * line[3]
        least, most = min(least, along), max(most, along)
    return least, most


@compiled
def _merged(sums: Floats, extents: Floats) -> tuple[Floats, Floats]:
    """Pieces on one line, near each other along it, as one; extents along the merged lines."""
    walls, reach, lines = np.empty_like(sums), np.empty_like(extents), np.empty((len(sums), 5))
    count = 0
    for piece in range(len(sums)):
        line = _line(sums[piece])
        wall = 0
        while wall < count and not _is_part(lines[wall], reach[wall], line, extents[piece]):
            wall += 1
        if wall == count:
            walls[count], reach[count] = sums[piece], extents[piece]
            count += 1
        else:
            _join(walls[wall], reach[wall], sums[piece], extents[piece])
        lines[wall, 0], lines[wall, 1], lines[wall, 2], lines[wall, 3], lines[wall, 4] = _line(walls[wall])
    return walls[:count], reach[:count]


@compiled
def _along(extent: Floats, line: Line, on: Line) -> tuple[float, float]:
    """An extent along one line as an extent along another one."""
    ends = np.empty(2)
    for end in range(2):
        x, y = line[0] + extent[end] * line[2] - on[0], line[1] + extent[end] * line[3] - on[1]
        ends[end] = x * on[2] + y * on[3]
    return ends.min(), ends.max()


@compiled
def _is_part(wall: Floats, reach: Floats, line: Line, extent: Floats) -> bool:
    """Whether a piece on a line is part of a wall whose line (5,) is `wall`."""
    on = wall[0], wall[1], wall[2], wall[3], wall[4]
    if abs(line[2] * on[3] - line[3] * on[2]) > np.sin(MERGE_ANGLE_RAD):
        return False
    if abs((line[0] - on[0]) * on[3] - (line[1] - on[1]) * on[2]) > MERGE_OFFSET_M:
        return False
    least, most = _along(extent, line, on)
    return bool(least <= reach[1] + MERGE_GAP_M and most >= reach[0] - MERGE_GAP_M)


@compiled
def _join(wall: Floats, reach: Floats, piece: Floats, extent: Floats) -> None:
    """The piece added to the wall, in place."""
    before, line = _line(wall), _line(piece)
    wall[:6] += piece[:6]
    wall[6] = max(wall[6], piece[6])
    wall[7], wall[8] = min(wall[7], piece[7]), max(wall[8], piece[8])
    after = _line(wall)
    least, most = _along(reach, before, after)
    low, high = _along(extent, line, after)
    reach[0], reach[1] = min(least, low), max(most, high)
