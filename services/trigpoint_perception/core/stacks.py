"""Segments of several rings that stand one above the other on one upright axis: what may be a pole."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.compiled import compiled
from trigpoint_perception.core.segments import Segments
from trigpoint_perception.settings import PoleSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

AXIS_HEIGHT_M = 3.0  # the axis is fitted to what stands lower, where there is enough: crowns and arms begin above
OUTLIER_M = 0.2  # of a ring's centre from the axis: another object
FRONT_MAX_M = 0.4  # from a segment's nearest point to the axis of the cylinder it may be the front of, at most
NARROW_QUANTILE = 0.25  # of the widths of a pole's rings: narrow as the pole is where a panel hides most of it
PANEL_RATIO = 2.0  # times the pole's own width


@dataclass(frozen=True, slots=True)
class Stacks:
    """Stacks (k,) of segments: stack i is segment[begin[i] : begin[i + 1]]; begin (k + 1,)."""

    segment: Ints
    begin: Ints

    @property
    def label(self) -> Ints:
        """The stack of each segment."""
        return np.repeat(np.arange(len(self.begin) - 1), np.diff(self.begin))

    def chosen(self, kept: Bools) -> "Stacks":
        """The stacks without the segments that are not kept, stacks without any left out."""
        size = np.bincount(self.label[kept], minlength=len(self.begin) - 1)
        return _of_sizes(self.segment[kept], size[size > 0])


@dataclass(frozen=True, slots=True)
class _Axes:
    """The straight axes through stacks (k,): which segments are near them, how many rings those are and how many they
    span, their run per rise, and the segments' root mean square distance from them."""

    near: Bools
    rings: Ints
    span: Ints
    slope: Floats
    scatter_m: Floats


def upright_stacks(
    segments: Segments, sensor_m: Floats, settings: PoleSettings, *, clearance_m: float
) -> tuple[Stacks, Ints]:
    """What stands on upright axes, from as low to as high as poles do, and the number of rings of each stack."""
    thin = _thin_segments(segments, settings, clearance_m)
    centre_m = _segment_centres(segments, thin, sensor_m)
    linked = _linked_stacks(centre_m, settings)
    tall = _reach(segments.mean_height_m[thin[linked.segment]], linked, settings)
    linked = linked.chosen(tall[linked.label])
    stacks = Stacks(thin[linked.segment], linked.begin)
    ring, height_m = segments.ring[stacks.segment], segments.mean_height_m[stacks.segment]
    axes = _Axes(*_fitted_axes(centre_m[linked.segment], ring, height_m, stacks.begin))
    upright = _are_upright(axes, stacks, segments, settings)
    return stacks.chosen(axes.near & upright[stacks.label]), axes.rings[upright]


def shafts(stacks: Stacks, segments: Segments, *, step_rad: float, rings_min: int) -> Stacks:
    """Of each pole's segments those its axis is fitted to: low ones, where there are enough, that no panel or arm on it
    widens, for the axis is not behind the middle of a panel."""
    low = segments.mean_height_m[stacks.segment] <= AXIS_HEIGHT_M
    enough = np.bincount(stacks.label, weights=low) >= rings_min
    lower = stacks.chosen(low | ~enough[stacks.label])
    beam_m = step_rad * segments.near_m[lower.segment]
    width_m = segments.width_m[lower.segment] + beam_m
    by_width = np.lexsort((width_m, lower.label))
    quarter = lower.begin[:-1] + (NARROW_QUANTILE * (np.diff(lower.begin) - 1)).astype(np.int64)
    narrow_m = width_m[by_width[quarter]]
    return lower.chosen(width_m < PANEL_RATIO * narrow_m[lower.label] + 1.5 * beam_m)


def _of_sizes(segment: Ints, size: Ints) -> Stacks:
    return Stacks(segment, np.concatenate([[0], np.cumsum(size)]))


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
    out_m = segments.near_m[thin] + np.minimum(0.5 * segments.width_m[thin], FRONT_MAX_M)
    angle = segments.azimuth_rad[thin]
    return sensor_m[:2] + np.column_stack([out_m * np.cos(angle), out_m * np.sin(angle)])


def _linked_stacks(centre_m: Floats, settings: PoleSettings) -> Stacks:
    """Rows of centres (m, 2) that are linked by nearness, in groups of enough for a pole's rings."""
    label = _linked(centre_m, np.argsort(centre_m[:, 0], kind="stable"), settings.link_m)
    size = np.bincount(label)
    row = np.nonzero(size[label] >= settings.rings_min)[0]
    return _of_sizes(row[np.argsort(label[row], kind="stable")], size[size >= settings.rings_min])


def _reach(height_m: Floats, stacks: Stacks, settings: PoleSettings) -> Bools:
    """Whether stacks (k,) of segments at these heights (n,) reach down and up as far as a pole."""
    if not len(height_m):
        return np.zeros(0, dtype=np.bool_)
    low_m, high_m = np.minimum.reduceat(height_m, stacks.begin[:-1]), np.maximum.reduceat(height_m, stacks.begin[:-1])
    tall: Bools = (low_m <= settings.bottom_max_m) & (high_m >= settings.top_min_m)
    return tall & (high_m - low_m >= settings.extent_min_m)


def _are_upright(axes: _Axes, stacks: Stacks, segments: Segments, settings: PoleSettings) -> Bools:
    """Whether what is near the axes (k,) has enough points and rings, and stands upright."""
    count, height_m = segments.count[stacks.segment], segments.mean_height_m[stacks.segment]
    points = np.bincount(stacks.label, weights=np.where(axes.near, count, 0), minlength=len(stacks.begin) - 1)
    straight = (axes.scatter_m <= settings.scatter_max_m) & (axes.slope <= settings.tilt_max)
    filled = (axes.rings >= settings.rings_min) & (axes.rings >= settings.filled_share_min * axes.span)
    upright: Bools = straight & filled & (points >= settings.points_min)
    near = stacks.chosen(axes.near & upright[stacks.label])
    upright[upright] = _reach(height_m[axes.near & upright[stacks.label]], near, settings)
    return upright


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


@compiled
def _fitted_axes(
    centre_m: Floats, ring: Ints, height_m: Floats, begin: Ints
) -> tuple[Bools, Ints, Ints, Floats, Floats]:
    """Of stacks (k,) of centres (n, 2), ring after ring: which centres are near the axis, and `_Axes`' values."""
    stacks = len(begin) - 1
    near = np.zeros(len(centre_m), np.bool_)
    rings, span = np.zeros(stacks, np.int64), np.ones(stacks, np.int64)
    slope, scatter = np.zeros(stacks), np.zeros(stacks)
    for stack in range(stacks):
        part = slice(begin[stack], begin[stack + 1])
        near[part], rings[stack], span[stack], slope[stack], scatter[stack] = _axis(
            centre_m[part], ring[part], height_m[part], OUTLIER_M
        )
    return near, rings, span, slope, scatter


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
