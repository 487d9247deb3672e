"""Submaps that share triangles of landmarks: geometric hashing (Wolfson and Rigoutsos 1997) by triangles' sides, which
need no first guess of place or heading (stable triangle descriptors: Yuan et al. 2023)."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from trigpoint.client.core.constellations import Constellation
from trigpoint_perception.core.closures.settings import TriangleSettings
from trigpoint_perception.core.closures.submaps import Submap

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LIKE_APART_M = 1e3  # added between triangles of other kinds or the other sense of turning: they are never alike


@dataclass(frozen=True, slots=True, kw_only=True)
class Triangles:
    """Triangles (t,) of a set of submaps: described (t, 4) by sides in m, longest first, and what they are of;
    submap (t,) each is of; corner_m (t, 3, 2) opposite to those sides, in their submap's frame."""

    described: Floats
    submap: Ints
    corner_m: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Alike:
    """Two submaps that share triangles: index of the one and of the other, the motion T_other_one (3,) on which most
    triangles agree, and how many do."""

    one: int
    other: int
    motion: Floats
    votes: int


def triangles_of(submaps: Sequence[Submap], settings: TriangleSettings) -> Triangles:
    """The triangles of every submap's landmarks."""
    each = [_triangles(submap.landmarks, settings) for submap in submaps]
    return Triangles(
        described=np.vstack([described for described, _ in each] or [np.zeros((0, 4))]),
        submap=np.repeat(np.arange(len(each)), [len(described) for described, _ in each]).astype(np.int64),
        corner_m=np.concatenate([corner_m for _, corner_m in each] or [np.zeros((0, 3, 2))]),
    )


def _triangles(landmarks: Constellation, settings: TriangleSettings) -> tuple[Floats, Floats]:
    """Description (t, 4) and corners (t, 3, 2) of the triangles that neighbours make."""
    point_m = landmarks.point_m
    triple = _neighbouring(point_m, settings.neighbours)
    corner_m = point_m[triple]
    side_m = np.hypot(*(corner_m[:, [1, 2, 0]] - corner_m[:, [2, 0, 1]]).transpose(2, 0, 1))  # opposite each corner
    order = np.argsort(-side_m, axis=1, kind="stable")
    side_m = np.take_along_axis(side_m, order, axis=1)
    corner_m = np.take_along_axis(corner_m, order[:, :, None], axis=1)
    triple = np.take_along_axis(triple, order, axis=1)
    usable = (side_m[:, 2] >= settings.side_min_m) & (side_m[:, 0] <= settings.side_max_m)
    usable &= (side_m[:, :2] - side_m[:, 1:]).min(axis=1, initial=np.inf) >= settings.side_apart_m
    first, second = corner_m[:, 1] - corner_m[:, 0], corner_m[:, 2] - corner_m[:, 0]
    sense = first[:, 0] * second[:, 1] > first[:, 1] * second[:, 0]
    names = np.array(landmarks.kind, dtype=str)
    kind = (names == "corner").astype(np.int64)[triple] @ np.array([1, 2, 4])
    described = np.column_stack([side_m, LIKE_APART_M * (2 * kind + sense)])
    return described[usable], corner_m[usable]


def _neighbouring(point_m: Floats, neighbours: int) -> Ints:
    """Triples (t, 3) of points: each with any two of its neighbours, every triple once."""
    count = min(neighbours, len(point_m) - 1)
    if count < 2:
        return np.zeros((0, 3), dtype=np.int64)
    _, near = cKDTree(point_m).query(point_m, count + 1)
    pairs = np.array(list(combinations(range(1, count + 1), 2)), dtype=np.int64)
    own = np.repeat(np.arange(len(point_m)), len(pairs))
    triple = np.column_stack([own, near[:, pairs].reshape(-1, 2)]).astype(np.int64)
    return np.unique(np.sort(triple, axis=1), axis=0)


def alike(ones: Triangles, others: Triangles, settings: TriangleSettings) -> list[Alike]:
    """The pairs of submaps for which enough triangles agree on one motion, most votes first."""
    if not len(ones.submap) or not len(others.submap):
        return []
    found = cKDTree(ones.described).query_ball_tree(cKDTree(others.described), settings.tolerance_m, p=np.inf)
    first = np.repeat(np.arange(len(found)), [len(each) for each in found])
    second = np.array([row for each in found for row in each], dtype=np.int64)
    motion = _motions(ones.corner_m[first], others.corner_m[second])
    return _voted(ones.submap[first], others.submap[second], motion, settings)


def _motions(corner_m: Floats, other_m: Floats) -> Floats:
    """The rigid motions (k, 3) that lay triangles (k, 3, 2) on others best (Umeyama 1991, without scale)."""
    middle, other_middle = corner_m.mean(axis=1), other_m.mean(axis=1)
    a, b = corner_m - middle[:, None], other_m - other_middle[:, None]
    cross = (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]).sum(axis=1)
    turn = np.arctan2(cross, (a * b).sum(axis=(1, 2)))
    c, s = np.cos(turn), np.sin(turn)
    shift = other_middle - np.column_stack([c * middle[:, 0] - s * middle[:, 1], s * middle[:, 0] + c * middle[:, 1]])
    return np.column_stack([shift, turn])


def _voted(one: Ints, other: Ints, motion: Floats, settings: TriangleSettings) -> list[Alike]:
    """The motion with most votes of each pair of submaps, in two grids, so that no cell's edge parts what belongs
    together."""
    best: dict[tuple[int, int], Alike] = {}
    width = np.array([settings.cell_m, settings.cell_m, settings.cell_rad])
    for shift in (0.0, 0.5):
        cell = np.column_stack([one, other, np.floor(motion / width + shift).astype(np.int64)])
        _, group, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
        mean = np.zeros((len(count), 3))
        np.add.at(mean, group, motion / count[group][:, None])
        first = np.zeros(len(count), dtype=np.int64)
        first[group] = np.arange(len(group))
        for number in np.nonzero(count >= settings.votes_min)[0].tolist():
            pair = int(one[first[number]]), int(other[first[number]])
            if pair not in best or best[pair].votes < count[number]:
                best[pair] = Alike(one=pair[0], other=pair[1], motion=mean[number], votes=int(count[number]))
    return sorted(best.values(), key=lambda each: (-each.votes, each.one, each.other))
