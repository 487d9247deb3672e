"""Pole-like objects of one sweep: segments of several rings that stand one above the other, thin and in the open."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from trigpoint.compiled import compiled
from trigpoint_perception.core.circle import Arc, Circle, fitted_circle
from trigpoint_perception.core.segments import OrderedSweep, Segments
from trigpoint_perception.settings import PoleSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

PoleClass = Literal["pole", "trunk", "sign"]

AXIS_HEIGHT_M = 3.0  # the axis is fitted to what stands lower, where there is enough: crowns and arms begin above
OUTLIER_M = 0.2  # of a ring's centre from the axis: another object
CROWN_REACH_M = 1.5
CROWN_FROM_M = 0.3  # above the top of what was taken for the trunk, or as near beside it
CROWN_HEIGHT_MIN_M = 1.8
CROWN_GAP_M = 0.25  # between the trunk's surface and what hangs about it
CROWN_SHARE = 1.5  # points of the crown for each of the trunk
TRUNK_RADIUS_M = 0.17  # thicker than any lamp post
PANEL_WIDTH_M = (0.25, 1.3)
PANEL_HEIGHT_M = (1.2, 4.5)
PANEL_RATIO = 2.0  # times the pole's own width
NARROW_QUANTILE = 0.25  # of the widths of a pole's rings: narrow as the pole is where a panel hides most of it
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
    thin = _thin_segments(segments, settings, clearance_m)
    if len(thin) < settings.rings_min:
        return ()
    centre_m = _segment_centres(segments, thin, sensor_m)
    scene = _Scene(ordered, segments, sensor_m, settings, _slope_top(ordered, sensor_m), _flanking(ordered))
    poles = [
        scene.pole_of(thin[rows], centre_m[rows]) for rows in _stacks(centre_m, segments.mean_height_m[thin], settings)
    ]
    return tuple(pole for pole in poles if pole is not None)


def _thin_segments(segments: Segments, settings: PoleSettings, clearance_m: float) -> Ints:
    """Segments that may be part of a pole: narrow, nearer than what is beside them, above the ground."""
    return np.nonzero(
        segments.open_left
        & segments.open_right
        & (segments.width_m <= settings.width_max_m)
        & (segments.mean_height_m >= clearance_m)
        & (segments.near_m <= settings.range_max_m)
    )[0]


def _segment_centres(segments: Segments, thin: Ints, sensor_m: Floats) -> Floats:
    """Where the axis is (m, 2) if each segment is a cylinder's front."""
    out_m = segments.near_m[thin] + np.minimum(0.5 * segments.width_m[thin], 0.4)
    angle = segments.azimuth_rad[thin]
    return sensor_m[:2] + np.column_stack([out_m * np.cos(angle), out_m * np.sin(angle)])


def _stacks(centre_m: Floats, height_m: Floats, settings: PoleSettings) -> list[Ints]:
    """Rows of segments (m,) that are linked by nearness, in groups of enough rings that reach down and up as far as a
    pole does."""
    label = _linked(centre_m, np.argsort(centre_m[:, 0], kind="stable"), settings.link_m)
    size = np.bincount(label, minlength=len(label))
    rows = np.nonzero(size[label] >= settings.rings_min)[0]
    if not len(rows):
        return []
    rows = rows[np.argsort(label[rows], kind="stable")]
    begin = np.concatenate([[0], np.nonzero(np.diff(label[rows]))[0] + 1])
    low_m, high_m = np.minimum.reduceat(height_m[rows], begin), np.maximum.reduceat(height_m[rows], begin)
    upright = (low_m <= settings.bottom_max_m) & (high_m >= settings.top_min_m)
    upright &= high_m - low_m >= settings.extent_min_m
    return [rows for rows, kept in zip(np.split(rows, begin[1:]), upright, strict=True) if kept]


@compiled
def _linked(centre_m: Floats, by_x: Ints, link_m: float) -> Ints:
    """The group (m,) of each centre, named by the first in it: all that a chain of steps as short connects (a sweep
    along x over disjoint sets)."""
    group = np.arange(len(centre_m))
    for at in range(len(by_x)):
        one = by_x[at]
        for after in range(at + 1, len(by_x)):
            other = by_x[after]
            if centre_m[other, 0] - centre_m[one, 0] > link_m:
                break
            apart_m = np.hypot(centre_m[other, 0] - centre_m[one, 0], centre_m[other, 1] - centre_m[one, 1])
            if apart_m <= link_m:
                first, second = _root(group, one), _root(group, other)
                group[max(first, second)] = min(first, second)
    for row in range(len(group)):
        group[row] = _root(group, row)
    return group


@compiled
def _root(group: Ints, row: int) -> int:
    while group[row] != row:
        group[row] = group[group[row]]
        row = group[row]
    return row


def _slope_top(ordered: OrderedSweep, sensor_m: Floats) -> float:
    begin = int(ordered.ring_begin[-2])
    return float(np.median((ordered.point_m[begin:, 2] - sensor_m[2]) / np.maximum(ordered.run_m[begin:], 0.1)))


def _flanking(ordered: OrderedSweep) -> Floats:
    """Points (n, 2) at the height of what may stand beside a pole."""
    low_m, high_m = FLANK_HEIGHT_M
    return ordered.point_m[(ordered.height_m >= low_m) & (ordered.height_m <= high_m), :2]


@dataclass(frozen=True, slots=True)
class _Scene:
    ordered: OrderedSweep
    segments: Segments
    sensor_m: Floats
    settings: PoleSettings
    slope_top: float  # rise per run of the highest laser
    flanking_m: Floats  # (n, 2) points at the height of what may stand beside a pole

    def pole_of(self, chosen: Ints, centre_m: Floats) -> PerceivedPole | None:
        """The pole that a stack of segments is, None if it is none."""
        upright = self._upright(chosen, centre_m)
        if upright is None:
            return None
        chosen, rings = upright
        height_m = self.segments.mean_height_m[chosen]
        low = chosen[height_m <= AXIS_HEIGHT_M]
        circle = self._circle(self._shaft(low if len(low) >= self.settings.rings_min else chosen))
        if circle.residual_m > 2.5 * self.settings.range_sigma_m:
            return None
        bottom_m, top_m, points = float(height_m.min()), float(height_m.max()), int(self.segments.count[chosen].sum())
        if self._is_person(circle, top_m) or self._is_flanked(circle, points):
            return None
        return PerceivedPole(
            centre_m=circle.centre_m,
            covariance_m2=circle.covariance_m2,
            radius_m=circle.radius_m,
            radius_sigma_m=circle.radius_sigma_m,
            bottom_m=bottom_m,
            top_m=top_m,
            points=points,
            rings=rings,
            landmark_class=self._class_of(circle, top_m, points),
        )

    def _upright(self, chosen: Ints, centre_m: Floats) -> tuple[Ints, int] | None:
        """What of a stack stands on one upright axis, and the number of rings; None where that is too little."""
        limits = self.settings
        ring, height_m = self.segments.ring[chosen], self.segments.mean_height_m[chosen]
        near, rings, span, slope, scatter_m = _axis(centre_m, ring, height_m, OUTLIER_M)
        if rings < limits.rings_min or self.segments.count[chosen[near]].sum() < limits.points_min:
            return None
        bottom_m, top_m = height_m[near].min(), height_m[near].max()
        standing = bottom_m <= limits.bottom_max_m and top_m >= limits.top_min_m
        tall = top_m - bottom_m >= limits.extent_min_m
        straight = scatter_m <= limits.scatter_max_m and slope <= limits.tilt_max
        filled = rings >= limits.filled_share_min * span
        return (chosen[near], rings) if standing and tall and straight and filled else None

    def _shaft(self, chosen: Ints) -> Ints:
        """Of a pole's segments those no panel or arm on it widens: its axis is not behind the middle of a panel."""
        beam_m = self.ordered.step_rad * self.segments.near_m[chosen]
        width_m = self.segments.width_m[chosen] + beam_m
        narrow_m = float(np.sort(width_m)[int(NARROW_QUANTILE * (len(width_m) - 1))])
        return chosen[width_m < PANEL_RATIO * narrow_m + 1.5 * beam_m]

    def _circle(self, chosen: Ints) -> Circle:
        ordered, segments = self.ordered, self.segments
        rows = _rows(segments.first[chosen], segments.count[chosen], segments.ring[chosen], ordered.ring_begin)
        arc = Arc(
            point_m=self.ordered.point_m[rows, :2],
            viewpoint_m=self.sensor_m[:2],
            width_rad=self.segments.width_m[chosen] / self.segments.near_m[chosen],
            step_rad=self.ordered.step_rad,
        )
        return fitted_circle(arc, range_sigma_m=self.settings.range_sigma_m, radius_max_m=self.settings.radius_max_m)

    def _is_person(self, circle: Circle, top_m: float) -> bool:
        """Whether what is as thick as a person ends at a person's height, and not where the sensor's view does."""
        away_m = float(np.hypot(*(circle.centre_m - self.sensor_m[:2])))
        seen_to_m = float(self.sensor_m[2]) + away_m * self.slope_top
        return circle.radius_m > PERSON_RADIUS_M and top_m < PERSON_TOP_M and seen_to_m > top_m + PERSON_CLEAR_M

    def _is_flanked(self, circle: Circle, points: int) -> bool:
        """Whether something stands beside it at the same distance: a hedge, a car, a wall with windows."""
        sight = circle.centre_m - self.sensor_m[:2]
        beside = _beside(self.flanking_m, circle.centre_m, sight / np.hypot(sight[0], sight[1]), circle.radius_m)
        return beside > FLANK_SHARE * points

    def _class_of(self, circle: Circle, top_m: float, points: int) -> PoleClass:
        around = self.segments.mean_m, self.segments.mean_height_m, self.segments.width_m, self.segments.count
        crown, panels = _surroundings(*around, circle.centre_m, np.array([circle.radius_m, top_m]))
        if crown >= CROWN_SHARE * points or circle.radius_m > TRUNK_RADIUS_M:
            return "trunk"
        return "sign" if panels >= PANEL_RINGS else "pole"


@compiled
def _surroundings(
    mean_m: Floats, height_m: Floats, width_m: Floats, count: Ints, centre_m: Floats, size_m: Floats
) -> tuple[int, int]:
    """The points of a crown about a pole and the rings of a panel on it, by the segments (m,) of the sweep; size_m
    (2,): the pole's radius and top."""
    radius, top = size_m
    panel_width = max(PANEL_WIDTH_M[0], 2.0 * PANEL_RATIO * radius)
    crown_from = max(top - CROWN_FROM_M, CROWN_HEIGHT_MIN_M)
    crown, panels = 0, 0
    for row in range(len(count)):
        x, y = mean_m[row, 0] - centre_m[0], mean_m[row, 1] - centre_m[1]
        if abs(x) > CROWN_REACH_M or abs(y) > CROWN_REACH_M:
            continue
        away, height, width = np.hypot(x, y), height_m[row], width_m[row]
        if radius + CROWN_GAP_M < away < CROWN_REACH_M and height > crown_from:
            crown += count[row]
        on_panel = away < PANEL_REACH_M and panel_width <= width <= PANEL_WIDTH_M[1]
        if on_panel and PANEL_HEIGHT_M[0] <= height <= PANEL_HEIGHT_M[1]:
            panels += 1
    return crown, panels


@compiled
def _axis(centre_m: Floats, ring: Ints, height_m: Floats, outlier_m: float) -> tuple[Bools, int, int, float, float]:
    """Which centres (m,) are near the middle one, their rings and the rings they span, the run per rise of the straight
    axis through them, and their root mean square distance from it."""
    middle_x, middle_y = np.median(centre_m[:, 0]), np.median(centre_m[:, 1])
    near = np.hypot(centre_m[:, 0] - middle_x, centre_m[:, 1] - middle_y) <= outlier_m
    if not near.any():
        return near, 0, 1, 0.0, 0.0
    x, y, z, rings = centre_m[near, 0], centre_m[near, 1], height_m[near], np.unique(ring[near])
    x, y, z = x - x.mean(), y - y.mean(), z - z.mean()
    rise = max((z * z).sum(), 1e-9)
    slope_x, slope_y = (x * z).sum() / rise, (y * z).sum() / rise
    scatter = np.sqrt(((x - slope_x * z) ** 2 + (y - slope_y * z) ** 2).mean())
    return near, len(rings), rings[-1] - rings[0] + 1, np.hypot(slope_x, slope_y), scatter


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
def _beside(point_m: Floats, centre_m: Floats, sight: Floats, radius_m: float) -> int:
    """The number of points to both sides of a pole, seen along the unit vector `sight`, as far away as it is."""
    count = 0
    for row in range(len(point_m)):
        x, y = point_m[row, 0] - centre_m[0], point_m[row, 1] - centre_m[1]
        if abs(x) > FLANK_REACH_M or abs(y) > FLANK_REACH_M:
            continue
        across = abs(x * sight[1] - y * sight[0])
        if across > radius_m + FLANK_FREE_M:
            count += abs(x * sight[0] + y * sight[1]) < FLANK_DEPTH_M
    return count
