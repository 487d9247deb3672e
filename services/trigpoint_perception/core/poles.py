"""Pole-like objects of one sweep: segments of several rings that stand one above the other, thin and in the open."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from trigpoint.compiled import compiled
from trigpoint_perception.core.circle import Arcs, Circles, fitted_circles
from trigpoint_perception.core.segments import OrderedSweep, Segments
from trigpoint_perception.core.stacks import PANEL_RATIO, Stacks, shafts, upright_stacks
from trigpoint_perception.settings import PoleSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

PoleClass = Literal["pole", "trunk", "sign"]

ROUND_SIGMAS = 2.5  # of the sensor's range: what lies farther from its circle is not round
CROWN_REACH_M = 1.5
CROWN_FROM_M = 0.3  # above the top of what was taken for the trunk, or as near beside it
CROWN_HEIGHT_MIN_M = 1.8
CROWN_GAP_M = 0.25  # between the trunk's surface and what hangs about it
CROWN_SHARE = 1.5  # points of the crown for each of the trunk
TRUNK_RADIUS_M = 0.17  # thicker than any lamp post
PANEL_WIDTH_M = (0.25, 1.3)
PANEL_HEIGHT_M = (1.2, 4.5)
PANEL_RINGS = 2
PANEL_REACH_M = 0.4  # from the pole's axis to the panel's middle
PERSON_RADIUS_M = 0.08
PERSON_TOP_M = 2.1
PERSON_CLEAR_M = 0.3  # seen to be free above
FLANK_SHARE = 0.5  # points beside it for each of its own
FLANK_REACH_M = 0.7
FLANK_FREE_M = 0.15  # from its surface: its own base, its own blurred edge
FLANK_DEPTH_M = 0.35
FLANK_HEIGHT_M = (0.35, 1.8)


@dataclass(frozen=True, slots=True, kw_only=True)
class PerceivedPole:
    """A pole-like object in the base frame: its axis near the ground (2,) with covariance (2, 2) in m^2, radius,
    bottom and top above the ground as far as they were seen, points and rings that hit it, and what it looks like."""

    centre_m: Floats
    covariance_m2: Floats
    radius_m: float
    radius_sigma_m: float
    bottom_m: float
    top_m: float
    points: int
    rings: int
    landmark_class: PoleClass


def perceived_poles(
    ordered: OrderedSweep, segments: Segments, sensor_m: Floats, settings: PoleSettings, *, clearance_m: float
) -> tuple[PerceivedPole, ...]:
    """The pole-like objects of a sweep, in no particular order."""
    stacks, rings = upright_stacks(segments, sensor_m, settings, clearance_m=clearance_m)
    if not len(rings):
        return ()
    circles = _circles(ordered, segments, stacks, sensor_m, settings)
    height_m = segments.mean_height_m[stacks.segment]
    stood = _Stood(
        rings=rings,
        points=np.add.reduceat(segments.count[stacks.segment], stacks.begin[:-1]),
        bottom_m=np.minimum.reduceat(height_m, stacks.begin[:-1]),
        top_m=np.maximum.reduceat(height_m, stacks.begin[:-1]),
    )
    kept = circles.residual_m <= ROUND_SIGMAS * settings.range_sigma_m
    kept &= ~_are_people(circles, stood.top_m, sensor_m, _slope_top(ordered, sensor_m))
    beside = _beside(_flanking(ordered.point_m, ordered.height_m), circles.centre_m, circles.radius_m, sensor_m[:2])
    kept &= beside <= FLANK_SHARE * stood.points
    return tuple(_poles(circles, stood, _classes(segments, circles, stood), np.nonzero(kept)[0]))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Stood:
    """Of stacks (k,): rings and points that hit them, lowest and highest ring above the ground."""

    rings: Ints
    points: Ints
    bottom_m: Floats
    top_m: Floats


def _circles(
    ordered: OrderedSweep, segments: Segments, stacks: Stacks, sensor_m: Floats, settings: PoleSettings
) -> Circles:
    """The circles (k,) that the shafts of stacks are."""
    shaft = shafts(stacks, segments, step_rad=ordered.step_rad, rings_min=settings.rings_min)
    chosen = shaft.segment
    rows = _rows(segments.first[chosen], segments.count[chosen], segments.ring[chosen], ordered.ring_begin)
    points = np.concatenate([[0], np.cumsum(segments.count[chosen])])
    arcs = Arcs(
        point_m=ordered.point_m[rows, :2],
        point_begin=points[shaft.begin],
        width_rad=segments.width_m[chosen] / segments.near_m[chosen],
        width_begin=shaft.begin,
        viewpoint_m=sensor_m[:2],
        step_rad=ordered.step_rad,
    )
    return fitted_circles(arcs, range_sigma_m=settings.range_sigma_m, radius_max_m=settings.radius_max_m)


def _are_people(circles: Circles, top_m: Floats, sensor_m: Floats, slope_top: float) -> Bools:
    """Whether what is as thick as a person ends at a person's height, and not where the sensor's view does; slope_top:
    rise per run of the highest laser."""
    sight_m = circles.centre_m - sensor_m[:2]
    seen_to_m = sensor_m[2] + np.hypot(sight_m[:, 0], sight_m[:, 1]) * slope_top
    thick = circles.radius_m > PERSON_RADIUS_M
    people: Bools = thick & (top_m < PERSON_TOP_M) & (seen_to_m > top_m + PERSON_CLEAR_M)
    return people


def _classes(segments: Segments, circles: Circles, stood: _Stood) -> list[PoleClass]:
    around = segments.mean_m, segments.mean_height_m, segments.width_m, segments.count
    crown, panels = _surroundings(*around, circles.centre_m, np.column_stack([circles.radius_m, stood.top_m]))
    trunks = (crown >= CROWN_SHARE * stood.points) | (circles.radius_m > TRUNK_RADIUS_M)
    return [
        "trunk" if trunk else "sign" if sign else "pole"
        for trunk, sign in zip(trunks, panels >= PANEL_RINGS, strict=True)
    ]


def _poles(circles: Circles, stood: _Stood, classes: list[PoleClass], kept: Ints) -> Iterator[PerceivedPole]:
    for row in kept:
        yield PerceivedPole(
            centre_m=circles.centre_m[row],
            covariance_m2=circles.covariance_m2[row],
            radius_m=float(circles.radius_m[row]),
            radius_sigma_m=float(circles.radius_sigma_m[row]),
            bottom_m=float(stood.bottom_m[row]),
            top_m=float(stood.top_m[row]),
            points=int(stood.points[row]),
            rings=int(stood.rings[row]),
            landmark_class=classes[row],
        )


def _slope_top(ordered: OrderedSweep, sensor_m: Floats) -> float:
    begin = int(ordered.ring_begin[-2])
    return float(np.median((ordered.point_m[begin:, 2] - sensor_m[2]) / np.maximum(ordered.run_m[begin:], 0.1)))


@compiled
def _flanking(point_m: Floats, height_m: Floats) -> Floats:
    """Of points (n, 3) those (m, 2) at the height of what may stand beside a pole."""
    flanking = np.empty((len(point_m), 2))
    found = 0
    for row in range(len(point_m)):
        if FLANK_HEIGHT_M[0] <= height_m[row] <= FLANK_HEIGHT_M[1]:
            flanking[found, 0], flanking[found, 1] = point_m[row, 0], point_m[row, 1]
            found += 1
    return flanking[:found]


@compiled
def _surroundings(
    mean_m: Floats, height_m: Floats, width_m: Floats, count: Ints, centre_m: Floats, size_m: Floats
) -> tuple[Ints, Ints]:
    """The points of crowns about poles (k,) and the rings of panels on them, by the segments (m,) of the sweep; size_m
    (k, 2): the poles' radii and tops."""
    crown, panels = np.zeros(len(centre_m), np.int64), np.zeros(len(centre_m), np.int64)
    for pole in range(len(centre_m)):
        radius, top = size_m[pole]
        panel_width = max(PANEL_WIDTH_M[0], 2.0 * PANEL_RATIO * radius)
        crown_from = max(top - CROWN_FROM_M, CROWN_HEIGHT_MIN_M)
        for row in range(len(count)):
            x, y = mean_m[row, 0] - centre_m[pole, 0], mean_m[row, 1] - centre_m[pole, 1]
            if abs(x) > CROWN_REACH_M or abs(y) > CROWN_REACH_M:
                continue
            away, height, width = np.hypot(x, y), height_m[row], width_m[row]
            if radius + CROWN_GAP_M < away < CROWN_REACH_M and height > crown_from:
                crown[pole] += count[row]
            on_panel = away < PANEL_REACH_M and panel_width <= width <= PANEL_WIDTH_M[1]
            if on_panel and PANEL_HEIGHT_M[0] <= height <= PANEL_HEIGHT_M[1]:
                panels[pole] += 1
    return crown, panels


@compiled
def _rows(first: Ints, count: Ints, ring: Ints, ring_begin: Ints) -> Ints:
    """The ordered sweep's rows of some segments, one after the other."""
    rows = np.empty(count.sum(), np.int64)
    found = 0
    for segment in range(len(first)):
        begin = ring_begin[ring[segment]]
        size = ring_begin[ring[segment] + 1] - begin
        for step in range(count[segment]):
            rows[found] = begin + (first[segment] - begin + step) % size
            found += 1
    return rows


@compiled
def _beside(point_m: Floats, centre_m: Floats, radius_m: Floats, sensor_m: Floats) -> Ints:
    """The number of points to both sides of poles (k,), seen from the sensor (2,), as far away as they are: hedges,
    cars, walls with windows."""
    count = np.zeros(len(centre_m), np.int64)
    for pole in range(len(centre_m)):
        sight_x, sight_y = centre_m[pole, 0] - sensor_m[0], centre_m[pole, 1] - sensor_m[1]
        away = np.hypot(sight_x, sight_y)
        for row in range(len(point_m)):
            x, y = point_m[row, 0] - centre_m[pole, 0], point_m[row, 1] - centre_m[pole, 1]
            if abs(x) > FLANK_REACH_M or abs(y) > FLANK_REACH_M:
                continue
            across = abs(x * sight_y - y * sight_x) / away
            if across > radius_m[pole] + FLANK_FREE_M:
                count[pole] += abs(x * sight_x + y * sight_y) / away < FLANK_DEPTH_M
    return count
