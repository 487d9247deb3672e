"""Things followed from sweep to sweep by the odometry, so that what was seen once by chance does not count."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from trigpoint.compiled import compiled
from trigpoint.geodesy.poses import transform_points
from trigpoint_perception.settings import TrackSettings

Floats = NDArray[np.float64]

CLASSES_KEPT = 50
FAR = 1e6  # cost of a pair outside the gate
ODOMETRY_SIGMA_M = 0.05  # of one track's place in the odometry's frame, over its window
KEPT_COVARIANCE = 0.25  # of a sight's covariance, at least, stays in the track's: sights share errors


@dataclass(frozen=True, slots=True, kw_only=True)
class Sight:
    """One landmark of one sweep in the base frame: (2,) in m, covariance (2, 2) in m^2; NaN diameter for a corner."""

    kind: str
    landmark_class: str
    position_m: Floats
    covariance_m2: Floats
    height_m: float
    diameter_m: float
    points: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """A thing: where it is in the odometry's frame (2,), its covariance (2, 2), the sweeps it was seen in within the
    window with its places there, the classes it was taken for, and whether it counts already."""

    number: int
    kind: str
    position_m: Floats
    covariance_m2: Floats
    seen: tuple[int, ...]
    places_m: tuple[tuple[float, float], ...]
    classes: tuple[str, ...]
    confirmed: bool = False


@dataclass(frozen=True, slots=True)
class Tracks:
    """All tracks, and the number of the next one."""

    tracks: tuple[Track, ...] = ()
    next_number: int = 0


def followed(
    tracks: Tracks, sights: Sequence[Sight], pose: Floats, *, sweep: int, settings: TrackSettings
) -> tuple[Tracks, tuple[int, ...]]:
    """The tracks after one more sweep, taken at pose (3,) in the odometry's frame, and the track of each sight.

    One to one, by the least sum of squared Mahalanobis distances within the gate; a sight without a track begins one.
    """
    placed_m, covariance_m2 = _placed(sights, pose)
    live = [track for track in tracks.tracks if sweep - track.seen[-1] <= settings.forgotten_after]
    partner = _partners(live, sights, placed_m, covariance_m2, settings)
    numbers, fresh, next_number = [], [], tracks.next_number
    for row, sight in enumerate(sights):
        if row in partner:
            at = partner[row]
            live[at] = _seen_again(live[at], sight, placed_m[row], covariance_m2[row], sweep, settings)
            numbers.append(live[at].number)
            continue
        fresh.append(_begun(next_number, sight, placed_m[row], covariance_m2[row], sweep))
        numbers.append(next_number)
        next_number += 1
    return Tracks((*live, *fresh), next_number), tuple(numbers)


def _placed(sights: Sequence[Sight], pose: Floats) -> tuple[Floats, Floats]:
    """Sights' positions (n, 2) and covariances (n, 2, 2) in the odometry's frame."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    turn = np.array([[c, -s], [s, c]])
    position_m = np.array([sight.position_m for sight in sights]).reshape(-1, 2)
    covariance_m2 = np.array([sight.covariance_m2 for sight in sights]).reshape(-1, 2, 2)
    return transform_points(pose, position_m), turn @ covariance_m2 @ turn.T


def _partners(
    live: list[Track], sights: Sequence[Sight], placed_m: Floats, covariance_m2: Floats, settings: TrackSettings
) -> dict[int, int]:
    """By sight the track it is of."""
    if not live or not sights:
        return {}
    at_m = np.array([track.position_m for track in live])
    known_m2 = np.array([track.covariance_m2 for track in live])
    cost = _costs(placed_m, covariance_m2, at_m, known_m2, np.array([settings.gate_m, settings.gate_chi_square]))
    cost[np.array([sight.kind for sight in sights])[:, None] != np.array([track.kind for track in live])] = FAR
    rows, columns = linear_sum_assignment(cost)
    return {int(row): int(column) for row, column in zip(rows, columns, strict=True) if cost[row, column] < FAR}


@compiled
def _costs(placed_m: Floats, covariance_m2: Floats, at_m: Floats, known_m2: Floats, gate: Floats) -> Floats:
    """The squared Mahalanobis distances (n, m) of sights from tracks, FAR outside the gate (2,) in m and chi square."""
    cost = np.full((len(placed_m), len(at_m)), FAR)
    for row in range(len(placed_m)):
        for column in range(len(at_m)):
            x, y = placed_m[row, 0] - at_m[column, 0], placed_m[row, 1] - at_m[column, 1]
            if x * x + y * y > gate[0] ** 2:
                continue
            xx = covariance_m2[row, 0, 0] + known_m2[column, 0, 0] + ODOMETRY_SIGMA_M**2
            yy = covariance_m2[row, 1, 1] + known_m2[column, 1, 1] + ODOMETRY_SIGMA_M**2
            xy = covariance_m2[row, 0, 1] + known_m2[column, 0, 1]
            chi_square = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy)
            if chi_square <= gate[1]:
                cost[row, column] = chi_square
    return cost


def _begun(number: int, sight: Sight, placed_m: Floats, covariance_m2: Floats, sweep: int) -> Track:
    return Track(
        number=number,
        kind=sight.kind,
        position_m=placed_m,
        covariance_m2=covariance_m2,
        seen=(sweep,),
        places_m=((float(placed_m[0]), float(placed_m[1])),),
        classes=(sight.landmark_class,),
    )


def _seen_again(
    track: Track, sight: Sight, placed_m: Floats, covariance_m2: Floats, sweep: int, settings: TrackSettings
) -> Track:
    position_m, known_m2 = _fused(track.position_m, track.covariance_m2, placed_m, covariance_m2)
    kept = [row for row, seen in enumerate(track.seen) if sweep - seen < settings.window]
    seen = (*(track.seen[row] for row in kept), sweep)
    places_m = (*(track.places_m[row] for row in kept), (float(placed_m[0]), float(placed_m[1])))
    return replace(
        track,
        position_m=position_m,
        covariance_m2=known_m2,
        seen=seen,
        places_m=places_m,
        classes=(*track.classes, sight.landmark_class)[-CLASSES_KEPT:],
        confirmed=track.confirmed or (len(seen) >= settings.seen_min and _stands(places_m, settings)),
    )


@compiled
def _fused(position_m: Floats, known_m2: Floats, placed_m: Floats, covariance_m2: Floats) -> tuple[Floats, Floats]:
    """A track's place (2,) and covariance (2, 2) after one more sight (Kalman's update for what stands still)."""
    gain = known_m2 @ np.linalg.inv(known_m2 + covariance_m2)
    place_m = position_m + gain @ (placed_m - position_m)
    fused_m2, least_m2 = known_m2 - gain @ known_m2, KEPT_COVARIANCE * covariance_m2
    return place_m, fused_m2 if np.trace(fused_m2) > np.trace(least_m2) else least_m2


def _stands(places_m: Sequence[tuple[float, float]], settings: TrackSettings) -> bool:
    """Whether a thing's places of the window show no drift."""
    path = np.array(places_m)
    late, early = path[len(path) // 2 :].mean(axis=0), path[: (len(path) + 1) // 2].mean(axis=0)
    return float(np.hypot(*(late - early))) <= settings.moved_max_m


def class_of(track: Track) -> str:
    """What a thing was taken for most often, of equals the first."""
    return Counter(track.classes).most_common(1)[0][0]
