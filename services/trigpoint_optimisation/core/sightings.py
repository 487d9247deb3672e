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

CORNER = "corner"  # kind of a detection


@dataclass(frozen=True, slots=True, kw_only=True)
class Sightings:
    """Sightings (s,): drive, keyframe, track; point_m (s, 2) in the keyframe's base frame; covariance (s, 2, 2) of what
    is a sighting's own error; shared_m2 (s,): variance per axis of the error that all of a track's have in common;
    by_offset (s, 2, 2): how the point moves by the drive's range offsets, see `DriveState`."""

    drive: Ints
    keyframe: Ints
    track: Ints
    point_m: Floats
    covariance: Floats
    shared_m2: Floats
    by_offset: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Averaging:
    """What makes sightings of a drive's detections: the map's metres per metre; `noise` of detections that do not tell
    their own; `shared_share` of the variance of those that do is one error in a whole track; `slack_m`, 1-sigma, is
    granted to each sighting besides."""

    point_scale: float
    noise: DetectionNoise
    shared_share: float = 0.0
    slack_m: float = 0.0


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


def perceived_covariances(prepared: PreparedDrive) -> Floats:
    """Covariances (d, 2, 2) of the detected points in their keyframes' frames as the sensor tells them, else NaN."""
    detections = prepared.drive.detections
    if detections.covariance_m2 is None:
        return np.full((len(detections.stamp_ns), 2, 2), np.nan)
    c, s = np.cos(prepared.detection_offset[:, 2]), np.sin(prepared.detection_offset[:, 2])
    turn = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    turned: Floats = turn @ detections.covariance_m2 @ turn.transpose(0, 2, 1)
    return turned


def _by_offset(prepared: PreparedDrive) -> Floats:
    """How detected points move in their keyframes' frames by the drive's range offsets (d, 2, 2): along their rays."""
    detections, described = prepared.drive.detections, prepared.drive.described
    angle = detections.bearing_rad + described.landmark_sensor_yaw_rad + prepared.detection_offset[:, 2]
    corner = np.array([float(kind == CORNER) for kind in detections.kind])
    of_kind = np.column_stack([1.0 - corner, corner])
    ray: Floats = np.column_stack([np.cos(angle), np.sin(angle)])
    by_offset: Floats = np.einsum("da,dk->dak", ray, of_kind)
    return by_offset


def drive_sightings(prepared: PreparedDrive, track: Ints, averaging: Averaging) -> Sightings:
    """One sighting for each track and keyframe of a drive; `track` (d,) by detection, negative where none.

    Detections whose own covariance is told differ less among each other than from the truth: neighbouring sweeps hit
    the same side of the same thing. Their mean is taken to be no surer than one of them.
    """
    rows = np.nonzero(track >= 0)[0]
    names = np.column_stack([track[rows], prepared.detection_keyframe[rows]])
    unique, group = np.unique(names, axis=0, return_inverse=True)
    count = np.bincount(group, minlength=len(unique)).astype(np.float64)
    own = perceived_covariances(prepared)[rows]
    untold = np.isnan(own).any(axis=(1, 2))
    own[untold] = _detection_covariances(prepared, averaging.noise)[rows[untold]]
    mean = _means(own, group, count)
    told = np.bincount(group, weights=~untold, minlength=len(unique)) > 0
    share = np.where(told, averaging.shared_share, 0.0)
    alone = np.where(told, 1.0 - share, 1.0 / np.maximum(count, 1.0))
    common_m2 = np.where(told, 0.0, averaging.noise.common_sigma_m**2) + averaging.slack_m**2
    return Sightings(
        drive=np.full(len(unique), prepared.index, dtype=np.int64),
        keyframe=unique[:, 1],
        track=unique[:, 0],
        point_m=_means(keyframe_points(prepared, point_scale=averaging.point_scale)[rows], group, count),
        covariance=alone[:, None, None] * mean + common_m2[:, None, None] * np.eye(2),
        shared_m2=share * 0.5 * np.trace(mean, axis1=1, axis2=2),
        by_offset=_means(_by_offset(prepared)[rows], group, count),
    )


def _means(values: Floats, group: Ints, count: Floats) -> Floats:
    """The mean (g, ...) of the values (n, ...) of each group (n,), `count` (g,) of them."""
    total = np.zeros((len(count), *values.shape[1:]))
    np.add.at(total, group, values)
    return total / count.reshape(-1, *[1] * (values.ndim - 1))


def joined(parts: Sequence[Sightings]) -> Sightings:
    """The sightings of several drives as one."""
    return Sightings(
        drive=np.concatenate([part.drive for part in parts]),
        keyframe=np.concatenate([part.keyframe for part in parts]),
        track=np.concatenate([part.track for part in parts]),
        point_m=np.concatenate([part.point_m for part in parts]),
        covariance=np.concatenate([part.covariance for part in parts]),
        shared_m2=np.concatenate([part.shared_m2 for part in parts]),
        by_offset=np.concatenate([part.by_offset for part in parts]),
    )
