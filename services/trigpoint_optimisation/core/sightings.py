"""Detections of one track from one keyframe, averaged into one sighting with an honest covariance."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.geodesy.poses import transform_points
from trigpoint_optimisation.core.detection_noise import DetectionNoise
from trigpoint_optimisation.core.preparation import PreparedDrive, detected_points

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sightings:
    """Sightings (s,): drive, keyframe, track; point_m (s, 2) in the keyframe's base frame; covariance (s, 2, 2)."""

    drive: Ints
    keyframe: Ints
    track: Ints
    point_m: Floats
    covariance: Floats


def keyframe_points(prepared: PreparedDrive, *, point_scale: float) -> Floats:
    """Detected points (d, 2) in their keyframes' base frames, map metres."""
    return transform_points(prepared.detection_offset, detected_points(prepared, point_scale=point_scale))


def _detection_covariances(prepared: PreparedDrive, noise: DetectionNoise) -> Floats:
    """Covariances (d, 2, 2) of the detected points in their keyframes' frames."""
    detections, described = prepared.drive.detections, prepared.drive.described
    angle = detections.bearing_rad + described.landmark_sensor_yaw_rad + prepared.detection_offset[:, 2]
    c, s = np.cos(angle), np.sin(angle)
    along = np.full(len(angle), noise.range_sigma_m**2)
    across = (detections.range_m * noise.bearing_sigma_rad) ** 2
    xy = (along - across) * c * s
    return np.stack(
        [np.stack([along * c * c + across * s * s, xy], -1), np.stack([xy, along * s * s + across * c * c], -1)], -2
    )


def drive_sightings(prepared: PreparedDrive, track: Ints, *, point_scale: float, noise: DetectionNoise) -> Sightings:
    """One sighting for each track and keyframe of a drive; `track` (d,) by detection, negative where none."""
    rows = np.nonzero(track >= 0)[0]
    names = np.column_stack([track[rows], prepared.detection_keyframe[rows]])
    unique, group = np.unique(names, axis=0, return_inverse=True)
    count = np.bincount(group, minlength=len(unique)).astype(np.float64)
    point = np.zeros((len(unique), 2))
    covariance = np.zeros((len(unique), 2, 2))
    np.add.at(point, group, keyframe_points(prepared, point_scale=point_scale)[rows])
    np.add.at(covariance, group, _detection_covariances(prepared, noise)[rows])
    covariance = covariance / (count**2)[:, None, None] + noise.common_sigma_m**2 * np.eye(2)
    return Sightings(
        drive=np.full(len(unique), prepared.index, dtype=np.int64),
        keyframe=unique[:, 1],
        track=unique[:, 0],
        point_m=point / count[:, None],
        covariance=covariance,
    )


def joined(parts: Sequence[Sightings]) -> Sightings:
    """The sightings of several drives as one."""
    return Sightings(
        drive=np.concatenate([part.drive for part in parts]),
        keyframe=np.concatenate([part.keyframe for part in parts]),
        track=np.concatenate([part.track for part in parts]),
        point_m=np.concatenate([part.point_m for part in parts]),
        covariance=np.concatenate([part.covariance for part in parts]),
    )
