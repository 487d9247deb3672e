"""Rigid motions that lay two observed landmarks on two of the map (geometric hashing: Wolfson and Rigoutsos 1997)."""

import numpy as np
from numpy.typing import NDArray

from trigpoint.client.core.constellations import Constellation, same_kind
from trigpoint.geodesy.poses import transform_points

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SPACING_MIN_M = 1.0  # two landmarks closer together say next to nothing of the heading
TOLERANCE = 3.0  # sigmas, of a distance
PAIRS_MOST = 60  # observed pairs that propose: the longest, which say most of the heading
COMPARED_MOST = 8_000_000  # landmarks compared in all when proposals are tried, so that an answer stays quick:
# pairs with few likes go first, which say most of the place


def proposed_motions(observed: Constellation, known: Constellation) -> Floats:
    """Motions T_map_base (k, 3): x, y in m, heading in rad. One for each observed pair and each ordered pair of the
    map of like kinds and like distance."""
    first, second, distance_m, sigma_m = _observed_pairs(observed)
    a, b = np.nonzero(~np.eye(len(known), dtype=bool))
    spacing_m = np.hypot(*(known.point_m[b] - known.point_m[a]).T)
    order = np.argsort(spacing_m)
    low = np.searchsorted(spacing_m[order], distance_m - TOLERANCE * sigma_m)
    high = np.searchsorted(spacing_m[order], distance_m + TOLERANCE * sigma_m)
    pair, offset = _ranges(_fewest_first(high - low, most=COMPARED_MOST // (len(observed) * len(known))))
    like = order[low[pair] + offset]
    alike = same_kind(observed, known)
    fits = alike[first[pair], a[like]] & alike[second[pair], b[like]]
    pair, like = pair[fits], like[fits]
    return _laid(observed.point_m[first[pair]], observed.point_m[second[pair]], known.point_m, a[like], b[like])


def _observed_pairs(observed: Constellation) -> tuple[Ints, Ints, Floats, Floats]:
    """Indices (p,) and (p,) of the pairs that propose, their distance (p,) in m and its sigma (p,) in m."""
    first, second = np.triu_indices(len(observed), 1)
    between_m = observed.point_m[second] - observed.point_m[first]
    distance_m = np.hypot(*between_m.T)
    longest = np.argsort(-distance_m, kind="stable")[:PAIRS_MOST]
    chosen = longest[distance_m[longest] > SPACING_MIN_M]
    first, second, distance_m = first[chosen], second[chosen], distance_m[chosen]
    along = between_m[chosen] / distance_m[:, None]
    covariance_m2 = observed.covariance_m2[first] + observed.covariance_m2[second]
    sigma_m = np.sqrt(np.einsum("pi,pij,pj->p", along, covariance_m2, along))
    return first, second, distance_m, sigma_m


def _fewest_first(count: Ints, *, most: int) -> Ints:
    """The counts (p,), the largest set to 0 until at most so many are left in all."""
    rising = np.argsort(count, kind="stable")
    kept = np.zeros_like(count)
    within = rising[np.cumsum(count[rising]) <= most]
    kept[within] = count[within]
    return kept


def _ranges(count: Ints) -> tuple[Ints, Ints]:
    """For ranges of `count` (p,) members: the range of each member and its place in it, all one after the other."""
    owner = np.repeat(np.arange(len(count)), count)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)


def _laid(first_m: Floats, second_m: Floats, point_m: Floats, a: Ints, b: Ints) -> Floats:
    """Motions (k, 3) that lay the middle of a pair (k, 2), (k, 2) on the middle of points a and b, its direction along
    theirs."""
    local_m, map_m = second_m - first_m, point_m[b] - point_m[a]
    heading_rad = np.arctan2(map_m[:, 1], map_m[:, 0]) - np.arctan2(local_m[:, 1], local_m[:, 0])
    turn = np.column_stack([np.zeros((len(a), 2)), heading_rad])
    shift_m = 0.5 * (point_m[a] + point_m[b]) - transform_points(turn, 0.5 * (first_m + second_m))
    return np.column_stack([shift_m, heading_rad])
