"""A drive made ready for the graph: keyframes, motions between them, and every measurement hung on a keyframe."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.drives import CAMERA, Drive
from trigpoint.geodesy.projection import MapFrame, map_points_from_wgs84
from trigpoint_optimisation.core.odometry import (
    DeadReckonedPath,
    Motions,
    OdometryCalibration,
    OdometryNoise,
    TurnSource,
    dead_reckon,
    keyframe_motions,
    keyframe_stamps,
    relative_poses,
    turn_source,
)
from trigpoint_optimisation.settings import CalibrationPriors, OdometrySettings, SolveSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class PreparedDrive:
    """A drive at one calibration. stamp_ns (n,): its keyframes. Fixes (f,) and detections (d,) are named by the
    keyframe before them and the base's pose at their time in that keyframe's frame, (f, 3) and (d, 3).

    `fix_m` (f, 2) in the map; `fix_path_m` (f,) the path length there; `fix_usable` (f,) and `detection_usable` (d,)
    not ruled out beforehand.
    """

    index: int
    drive: Drive
    source: TurnSource
    calibration: OdometryCalibration
    stamp_ns: Ints
    motions: Motions
    fix_m: Floats
    fix_path_m: Floats
    fix_usable: Bools
    fix_keyframe: Ints
    fix_offset: Floats
    detection_usable: Bools
    detection_keyframe: Ints
    detection_offset: Floats

    @property
    def camera(self) -> bool:
        """Whether the landmark sensor is a camera, which tells ranges by the size of things."""
        return self.drive.described.landmark_sensor_model == CAMERA

    def nominal_antenna_m(self, point_scale: float) -> Floats:
        """The lever arm (2,) of the antenna as described: x, y in map metres, base frame."""
        return point_scale * np.array([self.drive.described.antenna_x_m, self.drive.described.antenna_y_m])

    def hung(self, stamp_ns: Ints) -> tuple[Ints, Floats]:
        """The keyframe (m,) before each stamp and the base's pose (m, 3) at the stamp in its frame."""
        keyframe, offset, _ = _hung(self.motions.path, self.stamp_ns, stamp_ns)
        return keyframe, offset


def nominal_calibration(drive: Drive, priors: CalibrationPriors, *, point_scale: float) -> OdometryCalibration:
    """The calibration a drive starts from: nominal, with a turn bias knot every `turn_bias_knot_s`."""
    first, last = int(drive.wheels.stamp_ns[0]), int(drive.wheels.stamp_ns[-1])
    knots = np.arange(first, max(last, first + 1), round(priors.turn_bias_knot_s * 1e9), dtype=np.int64)
    return OdometryCalibration(
        speed_scale=point_scale, turn_scale=1.0, delay_s=0.0, bias_stamp_ns=knots, turn_bias=np.zeros(len(knots))
    )


def odometry_noise(source: TurnSource, settings: OdometrySettings) -> OdometryNoise:
    """The noise of a drive's odometry by where its yaw rate comes from."""
    by_imu = source is TurnSource.IMU
    if source is TurnSource.COMMAND:
        return _command_noise(settings)
    if source is TurnSource.SAMPLED_WHEELS:
        return _sampled_noise(settings)
    unmeasured = source is TurnSource.NONE
    heading_rad = settings.heading_unmeasured_rad if unmeasured else settings.heading_rad
    return OdometryNoise(
        along_m=settings.along_m,
        across_m=settings.across_imu_m if by_imu else settings.across_m,
        heading_rad=settings.heading_imu_rad if by_imu else heading_rad,
        heading_rad_per_sqrt_s=settings.heading_rad_per_sqrt_s,
        turn_fraction=settings.turn_fraction_imu if by_imu else settings.turn_fraction,
        floor_m=settings.floor_m,
        floor_rad=settings.floor_imu_rad if by_imu else settings.floor_rad,
    )


def _sampled_noise(settings: OdometrySettings) -> OdometryNoise:
    """What comes on top of the sampling of wheels whose momentary speeds are all that is known."""
    return OdometryNoise(
        along_m=0.0,
        across_m=settings.sampled_across_m,
        heading_rad=0.0,
        heading_rad_per_sqrt_s=0.0,
        turn_fraction=0.0,
        floor_m=settings.floor_m,
        floor_rad=settings.floor_rad,
    )


def _command_noise(settings: OdometrySettings) -> OdometryNoise:
    return OdometryNoise(
        along_m=0.0,
        across_m=0.0,
        heading_rad=0.0,
        heading_rad_per_sqrt_s=settings.command_rad_per_sqrt_s,
        turn_fraction=settings.command_fraction,
        floor_m=0.0,
        floor_rad=0.0,
        along_m_per_sqrt_s=settings.command_m_per_sqrt_s,
        across_m_per_sqrt_s=settings.command_across_m_per_sqrt_s,
        along_fraction=settings.command_fraction,
        across_fraction=settings.command_across_fraction,
    )


def _hung(path: DeadReckonedPath, keyframe_ns: Ints, stamp_ns: Ints) -> tuple[Ints, Floats, Bools]:
    """The keyframe before each stamp, the base's pose at the stamp in its frame, and whether wheels cover it."""
    keyframe = np.clip(np.searchsorted(keyframe_ns, stamp_ns, side="right") - 1, 0, len(keyframe_ns) - 1)
    offset = relative_poses(path.at(keyframe_ns[keyframe]), path.at(stamp_ns))
    covered = (stamp_ns >= keyframe_ns[0]) & (stamp_ns <= keyframe_ns[-1])
    return keyframe, offset, covered


def prepared_drive(
    drive: Drive,
    frame: MapFrame,
    settings: SolveSettings,
    *,
    index: int,
    calibration: OdometryCalibration,
    keyframe_ns: Ints | None = None,
) -> PreparedDrive:
    """The drive ready for the graph; `keyframe_ns` keeps earlier keyframes under a new calibration."""
    source, odometry = turn_source(drive), settings.odometry
    if keyframe_ns is None:
        path = dead_reckon(drive, calibration, max_gap_s=odometry.max_gap_s)
        keyframe_ns = keyframe_stamps(
            path, distance_m=odometry.keyframe_m, turn_rad=odometry.keyframe_rad, moving_s=odometry.keyframe_moving_s
        )
    motions = keyframe_motions(
        drive, calibration, keyframe_ns, noise=odometry_noise(source, odometry), max_gap_s=odometry.max_gap_s
    )
    fixes, detections = drive.fixes, drive.detections
    fix_keyframe, fix_offset, fix_covered = _hung(motions.path, keyframe_ns, fixes.stamp_ns)
    keyframe, offset, covered = _hung(motions.path, keyframe_ns, detections.stamp_ns)
    return PreparedDrive(
        index=index,
        drive=drive,
        source=source,
        calibration=calibration,
        stamp_ns=keyframe_ns,
        motions=motions,
        fix_m=map_points_from_wgs84(fixes.lat_deg, fixes.lon_deg, frame),
        fix_path_m=motions.path.length_at(fixes.stamp_ns),
        fix_usable=fix_covered,
        fix_keyframe=fix_keyframe,
        fix_offset=fix_offset,
        detection_usable=covered & (detections.range_m <= settings.detections.max_range_m),
        detection_keyframe=keyframe,
        detection_offset=offset,
    )


def detected_points(prepared: PreparedDrive, *, point_scale: float) -> Floats:
    """The detected points (d, 2) in the base frame at their time, in map metres."""
    described, detections = prepared.drive.described, prepared.drive.detections
    bearing = detections.bearing_rad + described.landmark_sensor_yaw_rad
    range_m = detections.range_m * point_scale
    mount = (described.landmark_sensor_x_m * point_scale, described.landmark_sensor_y_m * point_scale)
    return np.column_stack([mount[0] + range_m * np.cos(bearing), mount[1] + range_m * np.sin(bearing)])
