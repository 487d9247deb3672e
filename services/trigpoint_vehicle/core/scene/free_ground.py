"""Where something may stand: clear of streets and of where vehicles pass."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from trigpoint_vehicle.core.placement import street_distance_m
from trigpoint_vehicle.core.streets import Streets

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeGround:
    """The streets and the points all vehicles' rear axles pass, both in grid metres."""

    streets: Streets
    driven: cKDTree

    def is_clear(self, place_m: Floats, *, street_m: float, driven_m: float) -> Bools:
        """Whether places (n, 2) are so far from every street's middle and from every point driven over."""
        off_track: Bools = self.driven.query(place_m)[0] >= driven_m
        return off_track & (street_distance_m(self.streets, place_m) >= street_m)


def is_apart(place_m: Floats, others_m: Floats, distance_m: float) -> Bools:
    """Whether places (n, 2) are so far from all others (m, 2)."""
    if len(others_m) == 0:
        return np.ones(len(place_m), dtype=np.bool_)
    apart: Bools = cKDTree(others_m).query(place_m)[0] >= distance_m
    return apart


def spread_out(place_m: Floats, *, count: int, distance_m: float) -> Ints:
    """The numbers (up to `count`,) of the first places of (n, 2) that are so far from one another, in order."""
    chosen = list[int]()
    for number, one in enumerate(place_m):
        if len(chosen) == count:
            break
        if not chosen or np.hypot(*(place_m[chosen] - one).T).min() >= distance_m:
            chosen.append(number)
    return np.array(chosen, dtype=np.int64)
