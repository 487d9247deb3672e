"""Which tracks of different passes and vehicles are the same landmark: joint shifts voted for, then nearest pairs."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from trigpoint_optimisation.settings import DetectionSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ROTATIONS_RAD = np.radians([0.0, -1.5, 1.5, -3.0, 3.0])
RUNNER_UP_RATIO = 1.5  # the best shift needs this many times the votes of the best one elsewhere
PASS_GAP_M = 120.0  # tracks of one drive closer along the path belong to the same pass


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracks:
    """All tracks of all drives. point_m (t, 2) in the map; drive (t,); path_m (t,) where along its drive each was
    seen; kind (t,) numbered; `apart`: pairs that cannot be one landmark."""

    point_m: Floats
    drive: Ints
    path_m: Floats
    kind: Ints
    apart: frozenset[tuple[int, int]]


class LandmarkGroups:
    """Tracks joined into landmarks, never two that were seen apart."""

    def __init__(self, count: int, apart: Iterable[tuple[int, int]]) -> None:
        self._root = list(range(count))
        self._members = [{track} for track in range(count)]
        self._enemies: list[set[int]] = [set() for _ in range(count)]
        for a, b in apart:
            self._enemies[a].add(b)
            self._enemies[b].add(a)

    def _find(self, track: int) -> int:
        while self._root[track] != track:
            self._root[track] = self._root[self._root[track]]
            track = self._root[track]
        return track

    def join(self, a: int, b: int) -> bool:
        """Whether the landmarks of two tracks are one now."""
        a, b = self._find(a), self._find(b)
        if a == b:
            return True
        if len(self._members[a]) < len(self._members[b]):
            a, b = b, a
        if self._enemies[a] & self._members[b]:
            return False
        self._root[b] = a
        self._members[a] |= self._members[b]
        self._enemies[a] |= self._enemies[b]
        return True

    def landmark_of_track(self) -> Ints:
        """The landmark number (t,) of each track, numbered from 0 in order of their first tracks."""
        roots = np.array([self._find(track) for track in range(len(self._root))], dtype=np.int64)
        _, first, inverse = np.unique(roots, return_index=True, return_inverse=True)
        rank = np.empty(len(first), dtype=np.int64)
        rank[np.argsort(first, kind="stable")] = np.arange(len(first))
        return rank[inverse]


def joint_shift_pairs(a_m: Floats, b_m: Floats, *, settings: DetectionSettings) -> Ints:
    """Pairs (k, 2) of a's and b's that one common shift and small turn brings together; empty if no shift stands out.

    a_m (n, 2), b_m (m, 2). Every pair within reach votes for its shift; the best shift must have `min_votes`
    one-to-one pairs and clearly more than the best one elsewhere: rows of equal poles stay unassigned.
    """
    centre = a_m.mean(axis=0)
    best, runner_up = np.zeros((0, 2), dtype=np.int64), 0
    for turn in ROTATIONS_RAD:
        c, s = np.cos(turn), np.sin(turn)
        turned = (a_m - centre) @ np.array([[c, s], [-s, c]]) + centre
        pairs, second = _voted_pairs(turned, b_m, settings)
        if len(pairs) > len(best):
            best = pairs
        runner_up = max(runner_up, second if len(pairs) >= len(best) else 0)
    enough = len(best) >= settings.min_votes and len(best) >= RUNNER_UP_RATIO * runner_up
    return best if enough else np.zeros((0, 2), dtype=np.int64)


def _voted_pairs(a_m: Floats, b_m: Floats, settings: DetectionSettings) -> tuple[Ints, int]:
    """The best shift's one-to-one pairs (k, 2) and the number of pairs of the best shift elsewhere."""
    none = np.zeros((0, 2), dtype=np.int64)
    difference = b_m[None, :, :] - a_m[:, None, :]
    i, j = np.nonzero(np.hypot(difference[..., 0], difference[..., 1]) <= settings.vote_reach_m)
    if len(i) < settings.min_votes:
        return none, 0
    shift = difference[i, j]
    votes = np.array([len(near) for near in cKDTree(shift).query_ball_point(shift, settings.vote_cell_m)])
    top = int(np.argmax(votes))
    pairs = _one_to_one(i, j, shift, shift[top], settings.vote_cell_m)
    elsewhere = np.hypot(*(shift - shift[top]).T) > 2.0 * settings.vote_cell_m
    if not elsewhere.any():
        return pairs, 0
    other = np.nonzero(elsewhere)[0][int(np.argmax(votes[elsewhere]))]
    return pairs, len(_one_to_one(i, j, shift, shift[other], settings.vote_cell_m))


def _one_to_one(i: Ints, j: Ints, shift: Floats, centre: Floats, cell_m: float) -> Ints:
    """Pairs (k, 2) whose shift is within `cell_m` of the centre (refined once), nearest first, each point once."""
    near = np.hypot(*(shift - centre).T) <= cell_m
    centre = shift[near].mean(axis=0)
    distance = np.hypot(*(shift - centre).T)
    chosen: list[tuple[int, int]] = []
    used_i: set[int] = set()
    used_j: set[int] = set()
    for k in np.argsort(distance, kind="stable"):
        if distance[k] > cell_m:
            break
        if int(i[k]) not in used_i and int(j[k]) not in used_j:
            used_i.add(int(i[k]))
            used_j.add(int(j[k]))
            chosen.append((int(i[k]), int(j[k])))
    return np.array(chosen, dtype=np.int64).reshape(-1, 2)


def _passes(path_m: Floats, drive: Ints) -> Ints:
    """A number (k,) for each pass: same drive and no gap of `PASS_GAP_M` along the path."""
    order = np.lexsort((path_m, drive))
    fresh = (np.diff(drive[order]) != 0) | (np.diff(path_m[order]) > PASS_GAP_M)
    number = np.empty(len(order), dtype=np.int64)
    number[order] = np.concatenate([[0], np.cumsum(fresh)])
    return number


def voted_pairs(tracks: Tracks, *, settings: DetectionSettings) -> tuple[tuple[int, int, int], ...]:
    """(votes, track, track) of all pairs that a joint shift of a path segment against another pass supports."""
    tree = cKDTree(tracks.point_m)
    segment = np.floor(tracks.path_m / settings.segment_m).astype(np.int64)
    found: dict[tuple[int, int], int] = {}
    for drive, number in np.unique(np.column_stack([tracks.drive, segment]), axis=0):
        members = np.nonzero((tracks.drive == drive) & (segment == number))[0]
        if len(members) < settings.min_votes:
            continue
        near = np.unique(np.concatenate(tree.query_ball_point(tracks.point_m[members], settings.vote_reach_m)))
        near = near.astype(np.int64)
        middle = tracks.path_m[members].mean()
        near = near[(tracks.drive[near] != drive) | (np.abs(tracks.path_m[near] - middle) > PASS_GAP_M)]
        for pair, votes in _segment_pairs(tracks, members, near, settings):
            found[pair] = max(votes, found.get(pair, 0))
    return tuple(sorted(((votes, a, b) for (a, b), votes in found.items()), key=lambda row: (-row[0], row[1], row[2])))


def _segment_pairs(
    tracks: Tracks, members: Ints, near: Ints, settings: DetectionSettings
) -> Iterable[tuple[tuple[int, int], int]]:
    if len(near) < settings.min_votes:
        return
    number = _passes(tracks.path_m[near], tracks.drive[near])
    for each in range(int(number.max()) + 1):
        others = near[number == each]
        if len(others) < settings.min_votes:
            continue
        pairs = joint_shift_pairs(tracks.point_m[members], tracks.point_m[others], settings=settings)
        for a, b in pairs:
            first, second = int(members[a]), int(others[b])
            if tracks.kind[first] == tracks.kind[second]:
                yield (min(first, second), max(first, second)), len(pairs)
