"""Detections of the same thing in one pass, linked without known identities."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from trigpoint_optimisation.settings import DetectionSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

UNTRACKED = -1


@dataclass(slots=True)
class _OpenTracks:
    """Tracks a sweep may still extend; positions are running means."""

    number: Ints
    position_m: Floats
    count: Ints
    last_ns: Ints

    def keep(self, chosen: NDArray[np.bool_]) -> "_OpenTracks":
        return _OpenTracks(self.number[chosen], self.position_m[chosen], self.count[chosen], self.last_ns[chosen])


def mutual_pairs(a_m: Floats, b_m: Floats, gate_m: float) -> tuple[Ints, Ints]:
    """Indices (k,), (k,) of points that are each other's nearest and within the gate."""
    if not len(a_m) or not len(b_m):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    distance = np.hypot(a_m[:, None, 0] - b_m[None, :, 0], a_m[:, None, 1] - b_m[None, :, 1])
    nearest_b, nearest_a = distance.argmin(axis=1), distance.argmin(axis=0)
    i = np.arange(len(a_m))
    good = (nearest_a[nearest_b] == i) & (distance[i, nearest_b] <= gate_m)
    return i[good], nearest_b[good]


def linked_tracks(stamp_ns: Ints, point_m: Floats, usable: NDArray[np.bool_], *, settings: DetectionSettings) -> Ints:
    """The track number (d,) of each detection, UNTRACKED where it belongs to none.

    stamp_ns (d,) sorted, one value a sweep; point_m (d, 2): the detections in a frame that is smooth along the
    drive. A track ends after `track_gap_s` unseen; tracks of fewer than `min_detections` are dropped.
    """
    track = np.full(len(stamp_ns), UNTRACKED, dtype=np.int64)
    rows = np.nonzero(usable)[0]
    starts = np.concatenate([[0], np.nonzero(np.diff(stamp_ns[rows]))[0] + 1, [len(rows)]])
    empty = np.zeros(0, dtype=np.int64)
    tracks, total = _OpenTracks(empty, np.zeros((0, 2)), empty, empty), 0
    for first, end in zip(starts[:-1], starts[1:], strict=True):
        sweep = rows[first:end]
        if not len(sweep):
            continue
        now_ns = stamp_ns[sweep[0]]
        tracks = tracks.keep(tracks.last_ns >= now_ns - round(settings.track_gap_s * 1e9))
        i, j = mutual_pairs(point_m[sweep], tracks.position_m, settings.track_gate_m)
        tracks.count[j] += 1
        share = np.maximum(1.0 / tracks.count[j], 0.1)[:, None]
        tracks.position_m[j] += share * (point_m[sweep[i]] - tracks.position_m[j])
        tracks.last_ns[j] = now_ns
        track[sweep[i]] = tracks.number[j]
        fresh = np.setdiff1d(np.arange(len(sweep)), i)
        number = np.arange(total, total + len(fresh))
        track[sweep[fresh]] = number
        total += len(fresh)
        tracks = _OpenTracks(
            np.concatenate([tracks.number, number]),
            np.concatenate([tracks.position_m, point_m[sweep[fresh]]]),
            np.concatenate([tracks.count, np.ones(len(fresh), dtype=np.int64)]),
            np.concatenate([tracks.last_ns, np.full(len(fresh), now_ns)]),
        )
    return _renumbered(track, total, settings.min_detections)


def _renumbered(track: Ints, total: int, min_detections: int) -> Ints:
    """Tracks numbered from 0 without the short ones."""
    count = np.bincount(track[track >= 0], minlength=total)
    number = np.where(count >= min_detections, np.cumsum(count >= min_detections) - 1, UNTRACKED)
    return np.where(track >= 0, number[track], UNTRACKED) if total else track


def seen_together(track: Ints, stamp_ns: Ints) -> frozenset[tuple[int, int]]:
    """Pairs of tracks (smaller first) that one sweep saw as two things: they are not the same landmark."""
    rows = np.nonzero(track >= 0)[0]
    if not len(rows):
        return frozenset()
    sweep = np.unique(stamp_ns[rows], return_inverse=True)[1]
    by_sweep = np.argsort(sweep, kind="stable")
    ordered, sweep = track[rows][by_sweep], sweep[by_sweep]
    pairs = []
    for offset in range(1, int(np.bincount(sweep).max())):
        same = sweep[offset:] == sweep[:-offset]
        pairs.append(np.column_stack([ordered[:-offset][same], ordered[offset:][same]]))
    if not pairs:
        return frozenset()
    unique = np.unique(np.sort(np.concatenate(pairs), axis=1), axis=0)
    return frozenset((int(a), int(b)) for a, b in unique)


def close_pairs(point_m: Floats, gate_m: float) -> Ints:
    """Pairs (k, 2) of points that are each other's nearest and within the gate, nearest pair first."""
    if len(point_m) < 2:
        return np.zeros((0, 2), dtype=np.int64)
    distance, neighbour = cKDTree(point_m).query(point_m, k=2)
    other = neighbour[:, 1]
    i = np.arange(len(point_m))
    good = (other[other] == i) & (i < other) & (distance[:, 1] <= gate_m)
    order = np.argsort(distance[good, 1], kind="stable")
    return np.column_stack([i[good], other[good]])[order].astype(np.int64)
