"""The markings painted on every street: one table for the lidar and for aerial pictures."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SOLID_M = 1e9  # the period of a line without gaps
ZEBRA_BARS = 7


def _zebra(first_m: float, last_m: float) -> list[tuple[float, ...]]:
    return [(first_m, last_m, SOLID_M, SOLID_M, left_m, left_m + 0.5) for left_m in np.arange(ZEBRA_BARS) - 3.25]


# From, to along the street from its begin in m (below 0: from its end), period, painted length of each period, from, to
# across, to the left. Dashes in the middle, lines at the edges, a crossing and a stop line before either junction.
STRIPES: Floats = np.array(
    [
        (15.0, -15.0, 9.0, 3.0, -0.075, 0.075),
        (15.0, -15.0, SOLID_M, SOLID_M, 3.60, 3.75),
        (15.0, -15.0, SOLID_M, SOLID_M, -3.75, -3.60),
        *_zebra(9.0, 12.0),
        *_zebra(-12.0, -9.0),
        (12.8, 13.2, SOLID_M, SOLID_M, -3.5, -0.2),
        (-13.2, -12.8, SOLID_M, SOLID_M, 0.2, 3.5),
    ]
)


def whole_length(half_m: float) -> Floats:
    """The table (1, 6) of one strip over a street's whole length, so wide to either side of its middle."""
    return np.array([(0.0, -1e-9, SOLID_M, SOLID_M, -half_m, half_m)])


def _bounds_m(stripe: Floats, length_m: float) -> Floats:
    # (k, 4) from, to along and across of every painted piece of one street
    pieces = []
    for first, last, period, painted, right, left in stripe.tolist():
        begin, end = (bound if bound >= 0.0 else length_m + bound for bound in (first, last))
        starts = np.arange(begin, end, period)
        pieces += [(start, min(start + painted, end), right, left) for start in starts.tolist()]
    return np.array(pieces)


def marking_corners_m(street: Floats, stripe: Floats) -> Floats:
    """Corners (p, 4, 2) of every painted rectangle of streets (m, 4), in their metres."""
    corners = []
    for begin_x, begin_y, end_x, end_y in street.tolist():
        span = np.array([end_x - begin_x, end_y - begin_y])
        length_m = float(np.hypot(*span))
        ahead, left = span / length_m, np.array([-span[1], span[0]]) / length_m
        bounds = _bounds_m(stripe, length_m)
        along, across = bounds[:, [0, 1, 1, 0]], bounds[:, [2, 2, 3, 3]]
        corners.append((begin_x, begin_y) + along[..., None] * ahead + across[..., None] * left)
    return np.concatenate(corners)
