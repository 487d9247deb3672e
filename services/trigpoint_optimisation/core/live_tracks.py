"""Detections of the same thing in one pass, linked as the sweeps come."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from trigpoint_optimisation.core.tracklets import mutual_pairs
from trigpoint_optimisation.settings import DetectionSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LEAST_SHARE = 0.1  # of a new detection in a track's mean: the frame they are linked in drifts


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """What one sweep saw. point_odom_m (d, 2), the same in the frame of the keyframe it hangs on, point_m (d, 2) with
    covariance (d, 2, 2), `told` by the sensor with each or not; kind and signature (d,), and `row` (d,): which
    detections of the event these are."""

    stamp_ns: int
    sequence: int
    keyframe: int
    row: tuple[int, ...]
    point_odom_m: Floats
    point_m: Floats
    covariance: Floats
    told: bool
    kind: tuple[str, ...]
    signature: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """One detection of a track: its keyframe, its sweep, the point (2,) in that keyframe's frame, its covariance
    (2, 2), `told` by the sensor or not."""

    keyframe: int
    sequence: int
    point_m: Floats
    covariance: Floats
    told: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Sight:
    """Where a track was seen from one keyframe, the mean (2,) of its detections there: `covariance` (2, 2) of the error
    that is this sight's own, and `shared_m2`, the variance per axis of the one that all sights of the track have in
    common, 0 where the sensor tells no covariance."""

    point_m: Floats
    covariance: Floats
    shared_m2: float

    @property
    def whole_covariance(self) -> Floats:
        """Of both errors together (2, 2)."""
        whole: Floats = self.covariance + self.shared_m2 * np.eye(2)
        return whole


@dataclass(slots=True)
class Track:
    """One thing that a pass sees: where in the drive's own frame (2,), all its detections as they came, and those of
    them that the map has not used yet. `first` is the sequence and row of the first detection; `apart` are tracks that
    a sweep saw beside it."""

    number: int
    first: tuple[int, int]
    first_ns: int
    last_ns: int
    position_odom_m: Floats
    signature: str
    count: int = 1
    last_keyframe: int = 0
    kinds: Counter[str] = field(default_factory=Counter)
    seen: list[Seen] = field(default_factory=list)
    unused: list[Seen] = field(default_factory=list)
    apart: set[int] = field(default_factory=set)

    @property
    def kind(self) -> str:
        """What it was most often taken for; of several the first in the alphabet."""
        return min(self.kinds, key=lambda kind: (-self.kinds[kind], kind))

    def take(self, sweep: Sweep, row: int) -> None:
        """One more detection."""
        self.last_ns = max(self.last_ns, sweep.stamp_ns)
        self.last_keyframe = max(self.last_keyframe, sweep.keyframe)
        self.kinds[sweep.kind[row]] += 1
        seen = Seen(
            keyframe=sweep.keyframe,
            sequence=sweep.sequence,
            point_m=sweep.point_m[row],
            covariance=sweep.covariance[row],
            told=sweep.told,
        )
        self.seen.append(seen)
        self.unused.append(seen)

    def fresh(self, keyframe: int) -> list[Seen]:
        """The detections up to a keyframe that the map has not used yet."""
        return [each for each in self.unused if each.keyframe <= keyframe]

    def use(self, keyframe: int) -> list[Seen]:
        """The same, used from now on."""
        fresh = self.fresh(keyframe)
        self.unused = [each for each in self.unused if each.keyframe > keyframe]
        return fresh

    def begin_anew(self) -> None:
        """As if the map had used none."""
        self.unused = list(self.seen)


class OpenTracks:
    """The tracks that a sweep may still extend: by signature where detections carry one, else mutually nearest."""

    def __init__(self, settings: DetectionSettings) -> None:
        self._settings = settings
        self._open: list[Track] = []
        self._made = 0

    def take(self, sweep: Sweep) -> list[Track]:
        """The tracks that the sweep saw, old and new, in order of number."""
        gap_ns = round(self._settings.track_gap_s * 1e9)
        self._open = [track for track in self._open if track.last_ns >= sweep.stamp_ns - gap_ns]
        rows = [row for row, name in enumerate(sweep.signature) if not name]
        found = self._nearest(sweep, rows) | self._named(sweep)
        for row in range(len(sweep.signature)):
            found.setdefault(row, None)
        seen = [self._taken(sweep, row, track) for row, track in sorted(found.items())]
        numbers = {track.number for track in seen}
        for track in seen:
            track.apart |= numbers - {track.number}
        return sorted(seen, key=lambda track: track.number)

    def _nearest(self, sweep: Sweep, rows: list[int]) -> dict[int, Track | None]:
        nameless = [track for track in self._open if not track.signature]
        position = np.array([track.position_odom_m for track in nameless]).reshape(-1, 2)
        i, j = mutual_pairs(sweep.point_odom_m[rows], position, self._settings.track_gate_m)
        return {rows[int(a)]: nameless[int(b)] for a, b in zip(i, j, strict=True)}

    def _named(self, sweep: Sweep) -> dict[int, Track | None]:
        by_name: dict[str, Track] = {track.signature: track for track in self._open if track.signature}
        return {row: by_name.get(name) for row, name in enumerate(sweep.signature) if name}

    def _taken(self, sweep: Sweep, row: int, track: Track | None) -> Track:
        point = sweep.point_odom_m[row]
        if track is None:
            track = Track(
                number=self._made,
                first=(sweep.sequence, sweep.row[row]),
                first_ns=sweep.stamp_ns,
                last_ns=sweep.stamp_ns,
                position_odom_m=point.copy(),
                signature=sweep.signature[row],
            )
            self._made += 1
            self._open.append(track)
        else:
            track.count += 1
            track.position_odom_m += max(1.0 / track.count, LEAST_SHARE) * (point - track.position_odom_m)
        track.take(sweep, row)
        return track


def usable(track: Track, first_keyframe: int, keyframe: int) -> list[Seen]:
    """What was seen of a track between two keyframes and is not used yet."""
    return [each for each in track.fresh(keyframe) if each.keyframe >= first_keyframe]


def sight_of(seen: Sequence[Seen], *, shared_share: float, offset_m: float) -> Sight:
    """Detections of a track from one keyframe as one sight.

    Where the sensor tells covariances their mean is no surer than one of them, and `shared_share` of its variance is
    one error of the whole track, as in a whole solve (`sightings.drive_sightings`); `offset_m`, 1-sigma, by which all
    a drive's things may seem too near, is part of that error. Else detections are independent.
    """
    point_m: Floats = np.mean([each.point_m for each in seen], axis=0)
    mean: Floats = np.mean([each.covariance for each in seen], axis=0)
    if not any(each.told for each in seen):
        return Sight(point_m=point_m, covariance=mean / len(seen), shared_m2=0.0)
    shared_m2 = shared_share * 0.5 * float(np.trace(mean)) + offset_m**2
    return Sight(point_m=point_m, covariance=(1.0 - shared_share) * mean, shared_m2=shared_m2)
