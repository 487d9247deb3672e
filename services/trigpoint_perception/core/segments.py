"""Rings cut into segments at steps in depth: what one laser saw of one surface in one go."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint_perception.core.compiled import compiled
from trigpoint_perception.core.sweep import Sweep

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

GAP_STEPS = 3.5  # azimuth steps without a return between two points: nothing connects them
AZIMUTH_STEPS = 1 << 20  # of a full turn: finer than any sensor's encoder


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
    azimuth_rad = np.arctan2(sweep.direction_m[:, 1], sweep.direction_m[:, 0])
    turn = ((azimuth_rad + np.pi) / (2.0 * np.pi) * AZIMUTH_STEPS).astype(np.int64)
    row = np.argsort(sweep.ring * (AZIMUTH_STEPS + 1) + turn, kind="stable")
    ring, azimuth_rad = sweep.ring[row], azimuth_rad[row]
    step = np.diff(azimuth_rad)
    step = step[(step > 0.0) & (np.diff(ring) == 0)]
    direction_m = sweep.direction_m[row]
    return OrderedSweep(
        row=row,
        ring_begin=np.searchsorted(ring, np.arange(int(ring[-1]) + 2)),
        ring=ring,
        azimuth_rad=azimuth_rad,
        run_m=np.hypot(direction_m[:, 0], direction_m[:, 1]),
        height_m=height_m[row],
        point_m=sweep.point_m[row],
        step_rad=float(np.median(step)) if len(step) else 2.0 * np.pi,
    )


def segments_of(ordered: OrderedSweep, *, depth_step_m: float) -> Segments:
    """Each ring cut wherever neighbours differ by a step in depth or by missing returns."""
    first, count, left, right = _cut(
        ordered.ring_begin, ordered.azimuth_rad, ordered.run_m, ordered.step_rad, depth_step_m
    )
    azimuth_rad, width_m, near_m, mean_m, mean_height_m = _measured(
        first, count, ordered.ring_begin, ordered.ring, ordered.azimuth_rad, ordered.run_m, ordered.height_m,
        ordered.point_m,
    )  # fmt: skip
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
        begin, end = ring_begin[ring], ring_begin[ring + 1]
        size = end - begin
        if size < 2:
            continue
        cut = np.zeros(size, np.bool_)  # between a point and the next one round the ring
        gap = np.zeros(size, np.bool_)
        for number in range(size):
            here, there = begin + number, begin + (number + 1) % size
            turn = azimuth_rad[there] - azimuth_rad[here]
            if turn < 0.0:
                turn += 2.0 * np.pi
            gap[number] = turn > GAP_STEPS * step_rad
            allowed = depth_step_m + 2.0 * turn * min(run_m[here], run_m[there])
            cut[number] = gap[number] or abs(run_m[there] - run_m[here]) > allowed
        start = 0
        while start < size and not cut[start]:
            start += 1
        if start == size:
            continue  # a ring in one piece: all round the sensor, nothing by itself
        at = (start + 1) % size
        seen = 0
        while seen < size:
            length = 1
            while not cut[(at + length - 1) % size]:
                length += 1
            last, before, after = (at + length - 1) % size, (at - 1) % size, (at + length) % size
            first[found], count[found] = begin + at, length
            left[found] = gap[last] or run_m[begin + after] > run_m[begin + last]
            right[found] = gap[before] or run_m[begin + before] > run_m[begin + at]
            found += 1
            seen += length
            at = after
    return first[:found], count[:found], left[:found], right[:found]


@compiled
def _measured(
    first: Ints,
    count: Ints,
    ring_begin: Ints,
    ring: Ints,
    azimuth_rad: Floats,
    run_m: Floats,
    height_m: Floats,
    point_m: Floats,
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    size = len(first)
    middle, width, near = np.empty(size), np.empty(size), np.full(size, np.inf)
    mean, mean_height = np.zeros((size, 3)), np.zeros(size)
    for number in range(size):
        begin, end = ring_begin[ring[first[number]]], ring_begin[ring[first[number]] + 1]
        for step in range(count[number]):
            row = begin + (first[number] - begin + step) % (end - begin)
            near[number] = min(near[number], run_m[row])
            mean[number] += point_m[row]
            mean_height[number] += height_m[row]
        last = begin + (first[number] - begin + count[number] - 1) % (end - begin)
        turn = azimuth_rad[last] - azimuth_rad[first[number]]
        if turn < 0.0:
            turn += 2.0 * np.pi
        middle[number] = azimuth_rad[first[number]] + 0.5 * turn
        width[number] = turn * near[number]
        mean[number] /= count[number]
        mean_height[number] /= count[number]
    return middle, width, near, mean, mean_height
