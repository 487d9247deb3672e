"""What the landmark sensor says: range and bearing of landmarks in reach, with misses and clutter."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from trigpoint.events.observed import LandmarkDetection, LandmarksDetected
from trigpoint_vehicle.core.campus_settings import SweepSettings
from trigpoint_vehicle.core.placement import PlacedLandmarks
from trigpoint_vehicle.core.recording import Timed

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CLUTTER = -1  # the landmark number of a detection of nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class Sightings:
    """Detections (n,) sorted by sweep: number of the sweep and of the landmark (CLUTTER for none), range, bearing."""

    sweep: Ints
    landmark: Ints
    range_m: Floats
    bearing_rad: Floats


def _in_reach(sensor_pose: Floats, landmark_m: Floats, reach_m: float) -> tuple[Ints, Ints]:
    if len(landmark_m) == 0:
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    near = cKDTree(landmark_m).query_ball_point(sensor_pose[:, :2], reach_m, return_sorted=True)
    counts = np.array([len(found) for found in near], dtype=np.int64)
    return np.repeat(np.arange(len(near)), counts), np.concatenate([np.array(found, dtype=np.int64) for found in near])


def _true_sightings(
    sensor_pose: Floats, landmarks: PlacedLandmarks, settings: SweepSettings, *, scale: float, rng: np.random.Generator
) -> Sightings:
    sweep, landmark = _in_reach(sensor_pose, landmarks.position_m, settings.range_max_m * scale)
    offset_m = landmarks.position_m[landmark] - sensor_pose[sweep, :2]
    range_m = np.hypot(offset_m[:, 0], offset_m[:, 1]) / scale
    bearing = np.arctan2(offset_m[:, 1], offset_m[:, 0]) - sensor_pose[sweep, 2]
    near, far = settings.detection_probability, settings.detection_probability_far
    chance = near + (far - near) * range_m / settings.range_max_m
    seen = (rng.uniform(size=len(sweep)) < chance) & (range_m >= settings.range_min_m)
    noisy_m = range_m + rng.normal(0.0, settings.range_sigma_m, len(sweep))
    noisy_rad = bearing + rng.normal(0.0, settings.bearing_sigma_rad, len(sweep))
    seen &= (noisy_m > 0.0) & (noisy_m < settings.range_max_m)
    return Sightings(sweep=sweep[seen], landmark=landmark[seen], range_m=noisy_m[seen], bearing_rad=noisy_rad[seen])


def _clutter(sweeps: int, settings: SweepSettings, rng: np.random.Generator) -> Sightings:
    sweep = np.repeat(np.arange(sweeps), rng.poisson(settings.clutter_per_sweep, sweeps))
    low, high = settings.range_min_m**2, settings.range_max_m**2  # even over the area
    return Sightings(
        sweep=sweep,
        landmark=np.full(len(sweep), CLUTTER, dtype=np.int64),
        range_m=np.sqrt(rng.uniform(low, high, len(sweep))),
        bearing_rad=rng.uniform(-np.pi, np.pi, len(sweep)),
    )


def sightings_along(
    sensor_pose: Floats, landmarks: PlacedLandmarks, settings: SweepSettings, *, scale: float, rng: np.random.Generator
) -> Sightings:
    """All detections from sensor poses (n, 3) in grid metres; `scale` is grid metres for one metre on the ground.

    Within a sweep the order is that of bearing, so that it tells nothing of what was seen.
    """
    true = _true_sightings(sensor_pose, landmarks, settings, scale=scale, rng=rng)
    false = _clutter(len(sensor_pose), settings, rng)
    sweep = np.concatenate([true.sweep, false.sweep])
    bearing = (np.concatenate([true.bearing_rad, false.bearing_rad]) + np.pi) % (2.0 * np.pi) - np.pi
    order = np.lexsort([bearing, sweep])
    return Sightings(
        sweep=sweep[order],
        landmark=np.concatenate([true.landmark, false.landmark])[order],
        range_m=np.concatenate([true.range_m, false.range_m])[order],
        bearing_rad=bearing[order],
    )


def _detections(
    seen: Sightings, landmarks: PlacedLandmarks, settings: SweepSettings, rng: np.random.Generator
) -> list[LandmarkDetection]:
    known = [("pole", "", math.nan), *zip(landmarks.kind, landmarks.name, landmarks.diameter_m.tolist(), strict=True)]
    error_m = rng.normal(0.0, settings.diameter_sigma_m, len(seen.sweep)).tolist()
    detections = []
    columns = zip(seen.landmark.tolist(), seen.range_m.tolist(), seen.bearing_rad.tolist(), error_m, strict=True)
    for landmark, range_m, bearing_rad, wrong_m in columns:
        kind, name, diameter_m = known[landmark + 1]
        signature = name if settings.known_signatures else ""
        detections.append(LandmarkDetection(range_m, bearing_rad, kind, signature, max(diameter_m + wrong_m, 0.02)))
    return detections


def sweep_events(
    stamp_ns: Ints, seen: Sightings, landmarks: PlacedLandmarks, settings: SweepSettings, rng: np.random.Generator
) -> list[Timed]:
    """One event a sweep, those that saw nothing too. stamp_ns (n,) of the sweeps."""
    detections = _detections(seen, landmarks, settings, rng)
    bounds = np.searchsorted(seen.sweep, np.arange(len(stamp_ns) + 1)).tolist()
    return [
        (stamp, LandmarksDetected(detections=tuple(detections[bounds[sweep] : bounds[sweep + 1]])))
        for sweep, stamp in enumerate(stamp_ns.tolist())
    ]
