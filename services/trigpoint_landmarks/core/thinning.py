"""Lines with fewer places, and numbers of a few among many."""

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import LineString

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TOLERANCE_M = 0.1  # a line's shape is kept within it where few enough places suffice for that


def thinned(point_m: Floats, *, most: int) -> Floats:
    """At most so many, but at least two, of the places (n, 2) of a line, which keep its shape as well as they can
    (D. Douglas and T. Peucker, 1973)."""
    if len(point_m) < 2:
        return point_m
    line, tolerance_m = LineString(point_m), TOLERANCE_M
    found = line.simplify(tolerance_m, preserve_topology=False)
    while len(found.coords) > max(most, 2):
        tolerance_m *= 2.0
        found = line.simplify(tolerance_m, preserve_topology=False)
    return np.asarray(found.coords, dtype=np.float64)


def spread(count: int, *, most: int) -> Ints:
    """At most `most` numbers spread evenly over 0 … count - 1, both ends among them."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))
