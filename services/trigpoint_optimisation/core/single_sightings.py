"""Sightings that enter the graph one by one: a camera's, and those of other vehicles."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.geodesy.poses import transform_points
from trigpoint_optimisation.core.preparation import PreparedDrive
from trigpoint_optimisation.settings import DetectionSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

NO_LANDMARK = -1
VEHICLE = "vehicle"  # kind of a detection that is of another vehicle
MIN_RANGE_M = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class SingleSightings:
    """Sightings (s,) as the sensor gave them: drive, row (which detection of it), keyframe, T_keyframe_sensor (s, 3);
    ln_range of map metres, bearing_rad, centred_square_rad2 (bearing squared less the drive's mean); sigma (s, 2) of
    ln range and bearing. Seen was `landmark`, or if that is NO_LANDMARK the base of `seen_drive`, hung on its
    `seen_keyframe` at target_m (s, 2)."""

    drive: Ints
    row: Ints
    keyframe: Ints
    T_keyframe_sensor: Floats
    ln_range: Floats
    bearing_rad: Floats
    centred_square_rad2: Floats
    sigma: Floats
    landmark: Ints
    seen_drive: Ints
    seen_keyframe: Ints
    target_m: Floats


def sensor_poses(prepared: PreparedDrive, *, point_scale: float) -> Floats:
    """The landmark sensor's pose (d, 3) at each detection in the frame of the keyframe before it."""
    described, offset = prepared.drive.described, prepared.detection_offset
    mount = point_scale * np.array([described.landmark_sensor_x_m, described.landmark_sensor_y_m])
    heading = offset[:, 2] + described.landmark_sensor_yaw_rad
    return np.column_stack([transform_points(offset, mount), heading])


def sighting_sigmas(prepared: PreparedDrive, settings: DetectionSettings) -> Floats:
    """1-sigma (d, 2) of ln range and of bearing in rad of each detection."""
    range_m = np.maximum(prepared.drive.detections.range_m, MIN_RANGE_M)
    if prepared.camera:
        ln_range = np.hypot(settings.camera_range, settings.camera_inverse_range_per_m * range_m)
        return np.column_stack([ln_range, np.full(len(range_m), settings.camera_bearing_rad)])
    return np.column_stack([settings.range_sigma_m / range_m, np.full(len(range_m), settings.bearing_sigma_rad)])


@dataclass(frozen=True, slots=True, kw_only=True)
class Seeing:
    """What makes sightings of a drive's detections: the map's metres per metre, and the settings' noise."""

    point_scale: float
    settings: DetectionSettings


def drive_single_sightings(
    prepared: PreparedDrive, rows: Ints, seeing: Seeing, *, landmark: Ints | None = None, seen: Floats | None = None
) -> SingleSightings:
    """The detections `rows` (s,) of a drive one by one: of `landmark` (s,), or of what `seen` (s, 4) names: another
    drive, its keyframe, and x, y in m there."""
    detections = prepared.drive.detections
    square = detections.bearing_rad**2
    mean = float(square[prepared.detection_usable].mean()) if prepared.detection_usable.any() else 0.0
    other = np.full((len(rows), 4), float(NO_LANDMARK)) if seen is None else seen
    return SingleSightings(
        drive=np.full(len(rows), prepared.index, dtype=np.int64),
        row=rows,
        keyframe=prepared.detection_keyframe[rows],
        T_keyframe_sensor=sensor_poses(prepared, point_scale=seeing.point_scale)[rows],
        ln_range=np.log(np.maximum(detections.range_m[rows], MIN_RANGE_M) * seeing.point_scale),
        bearing_rad=detections.bearing_rad[rows],
        centred_square_rad2=square[rows] - mean,
        sigma=sighting_sigmas(prepared, seeing.settings)[rows],
        landmark=np.full(len(rows), NO_LANDMARK, dtype=np.int64) if landmark is None else landmark,
        seen_drive=other[:, 0].astype(np.int64),
        seen_keyframe=other[:, 1].astype(np.int64),
        target_m=other[:, 2:],
    )


def _of_landmarks(prepared: PreparedDrive, track: Ints, landmark_of_track: Ints, seeing: Seeing) -> SingleSightings:
    """A camera's sightings of landmarks; nothing for another sensor."""
    near = prepared.drive.detections.range_m > MIN_RANGE_M
    rows = np.nonzero((track >= 0) & near & prepared.camera)[0]
    return drive_single_sightings(prepared, rows, seeing, landmark=landmark_of_track[track[rows]])


def _of_vehicles(prepared: PreparedDrive, fleet: Sequence[PreparedDrive], seeing: Seeing) -> SingleSightings:
    """A drive's sightings of other vehicles that were driving at that time."""
    detections = prepared.drive.detections
    of_vehicle = prepared.detection_usable & np.array([kind == VEHICLE for kind in detections.kind], dtype=bool)
    parts = [np.zeros((0, 5))]
    for other in fleet:
        if other.drive.vehicle == prepared.drive.vehicle:
            continue
        named = np.array([name == other.drive.vehicle for name in detections.signature], dtype=bool)
        driving = (detections.stamp_ns >= other.stamp_ns[0]) & (detections.stamp_ns <= other.stamp_ns[-1])
        rows = np.nonzero(of_vehicle & named & driving)[0]
        keyframe, offset = other.hung(detections.stamp_ns[rows])
        parts.append(np.column_stack([rows, np.full(len(rows), other.index), keyframe, offset[:, :2]]))
    table = np.concatenate(parts)
    return drive_single_sightings(prepared, table[:, 0].astype(np.int64), seeing, seen=table[:, 1:])


def single_sightings(
    fleet: Sequence[PreparedDrive], track: Sequence[Ints], landmark_of_track: Ints, seeing: Seeing
) -> SingleSightings:
    """Every camera's sightings of landmarks, by track (d,) of each drive, and all sightings of other vehicles."""
    parts = [_of_landmarks(each, own, landmark_of_track, seeing) for each, own in zip(fleet, track, strict=True)]
    parts += [_of_vehicles(each, fleet, seeing) for each in fleet]
    return SingleSightings(
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in SingleSightings.__slots__}
    )
