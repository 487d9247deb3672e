"""Roughly where drives were, by their fixes: those that cannot have met need not be compared.

A receiver that is off by tens of metres, or silent for a while, makes an extent larger and leaves no place out; one
that is off by more than `FIX_OFF_M` does where it is for half a kilometre and longer.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.drives import FixSeries

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

EARTH_RADIUS_M = 6_371_000.0  # the mean one: distances are good to half a percent
FIX_OFF_M = 300.0  # nearly three times what NCLT's receivers, among buildings, are off by at worst (112 m)
SIGMAS = 5.0  # where a receiver says itself that it knows less
SPEED_MAX_MPS = 70.0  # of road vehicles, between a fix and a sweep
STRETCH_S = 120.0  # of a box
MEETING_M = 100.0  # between two vehicles that may see one place: a loop is closed over 12 m at most


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """Boxes around all places a drive can have been at, one a stretch: lowest and highest corner (k, 3) in m from the
    middle of the Earth, towards 0 and 90 degrees east on the equator and the north pole."""

    low_m: Floats
    high_m: Floats


def extent_of(stamp_ns: Ints, fixes: FixSeries) -> Extent | None:
    """The extent of sweeps at stamps (n,), in any order, by a drive's fixes; None where there is no sweep, or no fix
    that says where."""
    usable = np.isfinite(fixes.lat_deg) & np.isfinite(fixes.lon_deg)
    if not len(stamp_ns) or not usable.any():
        return None
    chosen = np.nonzero(usable)[0][np.argsort(fixes.stamp_ns[usable], kind="stable")]
    stamps = np.unique(stamp_ns)
    nearest = chosen[_nearest(fixes.stamp_ns[chosen], stamps)]
    away_s = np.abs(fixes.stamp_ns[nearest] - stamps) * 1e-9
    off_m = np.fmax(FIX_OFF_M, SIGMAS * fixes.sigma_m[nearest]) + SPEED_MAX_MPS * away_s
    place_m = earth_points(fixes.lat_deg[nearest], fixes.lon_deg[nearest])
    first = _stretches(stamps)
    return Extent(
        low_m=np.minimum.reduceat(place_m - off_m[:, None], first),
        high_m=np.maximum.reduceat(place_m + off_m[:, None], first),
    )


def cannot_meet(one: Extent | None, other: Extent | None) -> bool:
    """Whether two drives were never near enough to one another to know a place again; not, where either is unknown."""
    if one is None or other is None:
        return False
    near = (one.low_m[:, None] <= other.high_m + MEETING_M) & (other.low_m <= one.high_m[:, None] + MEETING_M)
    return not near.all(axis=2).any()


def _nearest(sorted_ns: Ints, stamp_ns: Ints) -> Ints:
    """Of sorted stamps (m,) the one nearest to each of others (n,)."""
    after = np.clip(np.searchsorted(sorted_ns, stamp_ns), 1, max(len(sorted_ns) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(sorted_ns) - 1)
    return np.where(stamp_ns - sorted_ns[before] <= sorted_ns[after] - stamp_ns, before, after)


def _stretches(sorted_ns: Ints) -> Ints:
    """Where stretches of equal times begin among sorted stamps (n,), none much shorter than `STRETCH_S`."""
    since_s = (sorted_ns - sorted_ns[0]) * 1e-9
    count = max(1, int(since_s[-1] / STRETCH_S))
    number = np.minimum(since_s * count / max(float(since_s[-1]), 1.0), count - 1).astype(np.int64)
    first: Ints = np.unique(number, return_index=True)[1]
    return first


def earth_points(lat_deg: Floats, lon_deg: Floats) -> Floats:
    """Places (n, 3) in m on a sphere: no grid, whose edge drives could be on both sides of."""
    lat, lon = np.radians(lat_deg), np.radians(lon_deg)
    return EARTH_RADIUS_M * np.column_stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
