"""Rings cut into segments at steps in depth: what one laser saw of one surface in one go."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.compiled import compiled
from trigpoint_perception.core.sweep import Sweep

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

GAP_STEPS = 3.5  # azimuth steps without a return between two points: nothing connects them
STEP_SAMPLED_EVERY = 7  # points: enough to know the step between neighbours
DIGIT_BITS = 11
DIGITS = 1 << DIGIT_BITS
AZIMUTH_STEPS = DIGITS * DIGITS - 1  # of a full turn: finer than any sensor's encoder


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderedSweep:
    """A sweep by ring, then counter-clockwise. `row` (n,): the sweep's point; `ring_begin` (rings + 1,).

    azimuth_rad and run_m (n,): direction and horizontal distance from the sensor; height_m (n,) above the ground;
    `step_rad`: between two neighbours of one ring.
    """

    row: Ints
    ring_begin: Ints
    ring: Ints
    azimuth_rad: Floats
    run_m: Floats
    height_m: Floats
    point_m: Floats
    step_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Segments:
    """Segments (m,): points [first, last] of the ordered sweep, counted round the ring where last < first.

    `open_left` and `open_right`: what follows counter-clockwise and clockwise is farther away, or nothing. Directions
    and widths from the sensor; `near_m` the nearest point's horizontal distance; mean_m (m, 3) in the base frame;
    `mean_height_m` above the ground.
    """

    first: Ints
    count: Ints
    ring: Ints
    open_left: Bools
    open_right: Bools
    azimuth_rad: Floats
    width_m: Floats
    near_m: Floats
    mean_m: Floats
    mean_height_m: Floats


def ordered_sweep(sweep: Sweep, height_m: Floats) -> OrderedSweep:
    """The points of a sweep in order of ring and azimuth."""
    row = _order(sweep.ring, sweep.azimuth_rad)
    ring, azimuth_rad = sweep.ring[row], sweep.azimuth_rad[row]
    sampled = np.arange(0, len(row) - 1, STEP_SAMPLED_EVERY)
    step = azimuth_rad[sampled + 1] - azimuth_rad[sampled]
    step = step[(step > 0.0) & (ring[sampled + 1] == ring[sampled])]
    return OrderedSweep(
        row=row,
        ring_begin=np.searchsorted(ring, np.arange(int(ring[-1]) + 2)),
        ring=ring,
        azimuth_rad=azimuth_rad,
        run_m=sweep.run_m[row],
        height_m=height_m[row],
        point_m=np.take(sweep.point_m, row, axis=0),
        step_rad=float(np.median(step)) if len(step) else 2.0 * np.pi,
    )


@compiled
def _order(ring: Ints, azimuth_rad: Floats) -> Ints:
    """Rows (n,) by ring, then by azimuth in steps, then as they were: two passes of a radix sort by azimuth's digits,
    one by ring."""
    size = len(ring)
    turn = np.empty(size, np.int64)
    for number in range(size):
        turn[number] = int((azimuth_rad[number] + np.pi) / (2.0 * np.pi) * AZIMUTH_STEPS)
    row = np.arange(size)
    for shift in (0, DIGIT_BITS):
        row = _counted(row, (turn >> shift) & (DIGITS - 1), DIGITS)
    return _counted(row, ring, ring.max() + 1)


@compiled
def _counted(row: Ints, digit: Ints, digits: int) -> Ints:
    """Rows (n,) in the order of their digits (by row), of equals as they were."""
    begin = np.zeros(digits + 1, np.int64)
    for number in range(len(digit)):
        begin[digit[number] + 1] += 1
    for number in range(digits):
        begin[number + 1] += begin[number]
    ordered = np.empty_like(row)
    for number in row:
        ordered[begin[digit[number]]] = number
        begin[digit[number]] += 1
    return ordered


def segments_of(ordered: OrderedSweep, *, depth_step_m: float) -> Segments:
    """Each ring cut wherever neighbours differ by a step in depth or by missing returns."""
    first, count, left, right = _cut(
        ordered.ring_begin, ordered.azimuth_rad, ordered.run_m, ordered.step_rad, depth_step_m
    )
    begin = ordered.ring_begin[ordered.ring[first]]
    size = ordered.ring_begin[ordered.ring[first] + 1] - begin
    rows = np.column_stack([first - begin, count, begin, size])
    azimuth_rad, width_m, near_m, mean_m, mean_height_m = _measured(
        rows, ordered.azimuth_rad, ordered.run_m, ordered.height_m, ordered.point_m
    )
    return Segments(
        first=first,
        count=count,
        ring=ordered.ring[first],
        open_left=left,
        open_right=right,
        azimuth_rad=azimuth_rad,
        width_m=width_m,
        near_m=near_m,
        mean_m=mean_m,
        mean_height_m=mean_height_m,
    )


@compiled
def _cut(
    ring_begin: Ints, azimuth_rad: Floats, run_m: Floats, step_rad: float, depth_step_m: float
) -> tuple[Ints, Ints, Bools, Bools]:
    total = len(azimuth_rad)
    first, count = np.empty(total, np.int64), np.empty(total, np.int64)
    left, right = np.empty(total, np.bool_), np.empty(total, np.bool_)
    found = 0
    for ring in range(len(ring_begin) - 1):
        begin, size = ring_begin[ring], ring_begin[ring + 1] - ring_begin[ring]
        run = run_m[begin : begin + size]
        cut, gap = _cuts(azimuth_rad[begin : begin + size], run, step_rad, depth_step_m)
        starts = np.nonzero(cut)[0]  # each segment begins after a cut; a ring in one piece is no segment
        for number in range(len(starts)):
            before, last = starts[number], starts[(number + 1) % len(starts)]
            at, after = (before + 1) % size, (last + 1) % size
            first[found], count[found] = begin + at, (last - before - 1) % size + 1
            left[found] = gap[last] or run[after] > run[last]
            right[found] = gap[before] or run[before] > run[at]
            found += 1
    return first[:found], count[:found], left[:found], right[:found]


@compiled
def _cuts(azimuth_rad: Floats, run_m: Floats, step_rad: float, depth_step_m: float) -> tuple[Bools, Bools]:
    """Whether a ring is cut between each point (n,) and the next one round, and whether returns are missing there."""
    size = len(run_m)
    cut, gap = np.zeros(size, np.bool_), np.zeros(size, np.bool_)
    if size < 2:
        return cut, gap
    for here in range(size):
        there = here + 1 if here + 1 < size else 0
        turn = azimuth_rad[there] - azimuth_rad[here]
        if turn < 0.0:
            turn += 2.0 * np.pi
        gap[here] = turn > GAP_STEPS * step_rad
        allowed = depth_step_m + 2.0 * turn * min(run_m[here], run_m[there])
        cut[here] = gap[here] or abs(run_m[there] - run_m[here]) > allowed
    return cut, gap


@compiled
def _measured(
    rows: Ints, azimuth_rad: Floats, run_m: Floats, height_m: Floats, point_m: Floats
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Middle azimuths, widths, nearest distances, means (m, 3) and mean heights; rows (m, 4): first point in its ring,
    count, where its ring begins, the ring's size."""
    total = len(rows)
    middle, width, near = np.empty(total), np.empty(total), np.full(total, np.inf)
    mean, height = np.zeros((total, 3)), np.zeros(total)
    for number in range(total):
        first, count, begin, size = rows[number]
        for step in range(first, first + count):
            row = begin + (step if step < size else step - size)
            near[number] = min(near[number], run_m[row])
            height[number] += height_m[row]
            for axis in range(3):
                mean[number, axis] += point_m[row, axis]
        turn = (azimuth_rad[row] - azimuth_rad[begin + first]) % (2.0 * np.pi)
        middle[number] = azimuth_rad[begin + first] + 0.5 * turn
        width[number] = turn * near[number]
        height[number] /= count
        mean[number] /= count
    return middle, width, near, mean, height
