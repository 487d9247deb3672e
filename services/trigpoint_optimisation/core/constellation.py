"""Where a handful of landmarks lies in a map, without a first guess; a place that is not unique is none.

Distances between pairs propose rigid motions, pairs that agree vote for one, the motions with most votes are tried on
all landmarks (geometric hashing: Wolfson and Rigoutsos 1997; "locate anywhere": Bosse and Zlot 2008).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from trigpoint.geodesy.poses import transform_points, wrap_angle_rad, wrap_angles_rad
from trigpoint_optimisation.core.alignment import weighted_rigid
from trigpoint_optimisation.core.tracklets import mutual_pairs

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MIN_MATCHED = 8  # landmarks: fewer are alike by chance somewhere in a map of hundreds
MIN_SHARE = 0.5  # of the landmarks seen: the others are new, or the place is another
RUNNER_UP_SHARE = 0.6  # of the matched ones, at most, may match anywhere else
PAIR_M = (6.0, 60.0)  # distance of two landmarks that propose a motion
PAIRS_MOST = 250
PAIR_TOLERANCE_M, PAIR_TOLERANCE_SHARE = 0.3, 0.005
CELL_M, CELL_RAD = 1.5, 0.035  # motions in one cell vote together
TRIED = 60  # motions with most votes
MATCH_M = (1.2, 0.6)  # a landmark lies on its like: before and after the motion is fitted to all
ELSEWHERE_M, ELSEWHERE_RAD = 3.0, 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Constellation:
    """Landmarks: point_m (n, 2) and kind (n,)."""

    point_m: Floats
    kind: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Match:
    """A place found: the motion T_map_local (3,), pairs (k, 2) of local and map landmarks, and how many matched at the
    best place elsewhere."""

    T_map_local: Floats
    pairs: Ints
    elsewhere: int


def constellation_match(local: Constellation, known: Constellation) -> Match | None:
    """The one place in the map where enough of the local landmarks have their like; None where there is no such place
    or another one is nearly as good."""
    if len(local.kind) < MIN_MATCHED or len(known.kind) < MIN_MATCHED:
        return None
    motions = _proposed(local, known)
    if not len(motions):
        return None
    tried = [_fitted(motion, local, known) for motion in _voted(motions, local)]
    motion, pairs = max(tried, key=lambda one: len(one[1]))
    centre = local.point_m.mean(axis=0)
    others = [len(found) for other, found in tried if _elsewhere(other, motion, centre)]
    elsewhere = max(others, default=0)
    enough = len(pairs) >= MIN_MATCHED and len(pairs) >= MIN_SHARE * len(local.kind)
    if not enough or elsewhere > RUNNER_UP_SHARE * len(pairs):
        return None
    return Match(T_map_local=motion, pairs=pairs, elsewhere=elsewhere)


def _pairs(point_m: Floats) -> tuple[Ints, Floats]:
    """Ordered pairs (k, 2) of points at a distance that says something, and the distances (k,)."""
    found = cKDTree(point_m).query_pairs(PAIR_M[1], output_type="ndarray").astype(np.int64).reshape(-1, 2)
    distance = np.hypot(*(point_m[found[:, 1]] - point_m[found[:, 0]]).T)
    found, distance = found[distance >= PAIR_M[0]], distance[distance >= PAIR_M[0]]
    return found, distance


def _proposed(local: Constellation, known: Constellation) -> Floats:
    """Motions (h, 3) that bring a local pair onto a pair of the map of the same length and kinds."""
    near, length = _pairs(local.point_m)
    far, far_length = _pairs(known.point_m)
    far, far_length = np.vstack([far, far[:, ::-1]]), np.concatenate([far_length, far_length])
    order = np.argsort(far_length, kind="stable")
    far, far_length = far[order], far_length[order]
    every = max(len(near) // PAIRS_MOST, 1)
    near, length = near[::every], length[::every]
    reach = PAIR_TOLERANCE_M + PAIR_TOLERANCE_SHARE * length
    low, high = np.searchsorted(far_length, length - reach), np.searchsorted(far_length, length + reach)
    a = np.repeat(near, high - low, axis=0)
    rows = np.concatenate([np.arange(first, last) for first, last in zip(low, high, strict=True)] or [np.zeros(0)])
    b = far[rows.astype(np.int64)].reshape(-1, 2)
    here, there = np.array(local.kind), np.array(known.kind)
    alike = (here[a] == there[b]).all(axis=1)
    return _motions(local.point_m, known.point_m, a[alike], b[alike])


def _motions(local_m: Floats, map_m: Floats, a: Ints, b: Ints) -> Floats:
    step, image = local_m[a[:, 1]] - local_m[a[:, 0]], map_m[b[:, 1]] - map_m[b[:, 0]]
    turn = wrap_angles_rad(np.arctan2(image[:, 1], image[:, 0]) - np.arctan2(step[:, 1], step[:, 0]))
    middle, image_middle = 0.5 * (local_m[a[:, 0]] + local_m[a[:, 1]]), 0.5 * (map_m[b[:, 0]] + map_m[b[:, 1]])
    turned = transform_points(np.column_stack([np.zeros((len(turn), 2)), turn]), middle)
    return np.column_stack([image_middle - turned, turn])


def _voted(motions: Floats, local: Constellation) -> Floats:
    """The motions (t, 3) that most others agree with, by where they bring the middle of the local landmarks."""
    centre = np.broadcast_to(local.point_m.mean(axis=0), (len(motions), 2))
    at = np.column_stack([transform_points(motions, centre) / CELL_M, motions[:, 2] / CELL_RAD])
    found: list[Floats] = []
    for shift in (0.0, 0.5):  # two grids, so that no cell's edge parts what belongs together
        cell = np.floor(at + shift).astype(np.int64)
        _, first, count = np.unique(cell, axis=0, return_index=True, return_counts=True)
        found.append(motions[first[np.argsort(-count, kind="stable")[:TRIED]]])
    return np.vstack(found)


def _fitted(motion: Floats, local: Constellation, known: Constellation) -> tuple[Floats, Ints]:
    """The motion fitted to all that match, and the pairs (k, 2) that do."""
    pairs = np.zeros((0, 2), dtype=np.int64)
    for gate_m in (*MATCH_M, MATCH_M[-1]):
        pairs = _matched(motion, local, known, gate_m)
        if len(pairs) < 3:
            return motion, pairs
        found = weighted_rigid(local.point_m[pairs[:, 0]], known.point_m[pairs[:, 1]], np.ones(len(pairs)))
        motion = np.array([found.x_m, found.y_m, found.heading_rad])
    return motion, pairs


def _matched(motion: Floats, local: Constellation, known: Constellation, gate_m: float) -> Ints:
    placed = transform_points(motion, local.point_m)
    near = np.nonzero(np.hypot(*(known.point_m - placed.mean(axis=0)).T) < 2.0 * PAIR_M[1])[0]
    i, j = mutual_pairs(placed, known.point_m[near], gate_m)
    pairs = [(int(a), int(near[b])) for a, b in zip(i, j, strict=True) if local.kind[a] == known.kind[near[b]]]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _elsewhere(motion: Floats, other: Floats, centre: Floats) -> bool:
    apart_m = float(np.hypot(*(transform_points(motion, centre) - transform_points(other, centre))))
    turned_rad = abs(wrap_angle_rad(float(motion[2] - other[2])))
    return apart_m > ELSEWHERE_M or turned_rad > ELSEWHERE_RAD
