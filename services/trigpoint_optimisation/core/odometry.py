"""A drive's dead reckoning and its keyframe-to-keyframe motions, with their derivatives by the calibration."""

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.drives import Drive
from trigpoint.geodesy.poses import wrap_angles_rad
from trigpoint_optimisation.core.sampled_wheels import (
    coarsely_sampled,
    sampled_speed_variance,
    sampled_turn_variance,
    without_wobble,
    wobble_radps,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SCALE_STEP = 1e-4  # dimensionless, step of the numeric derivative by speed and turn scale
DELAY_STEP_S = 0.01  # s, step of the central difference by the clock delay
BIAS_STEP = 1e-5  # rad, rad/s or rad/m, step of the numeric derivative by turn bias
MOVING_MPS = 0.02  # slower than this a vehicle stands
MAX_STEERING_RAD = 1.2  # tan() stays bounded for any steering input


class TurnSource(Enum):
    """Where a drive's yaw rate comes from; decides what its turn bias is a bias of."""

    IMU = "imu"
    STEERING = "steering"
    WHEELS = "wheels"
    SAMPLED_WHEELS = "sampled wheels"
    COMMAND = "command"
    NONE = "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryCalibration:
    """Calibration of one drive's odometry: true speed = `speed_scale` x measured; true turn = `turn_scale` x
    measured + bias, where turn is steering angle (rad) or yaw rate by TurnSource; the bias of an IMU is in rad/s, of
    wheels and commands in rad/m (unequal wheel radii turn per metre, not per second).

    The wheels' clock reads `delay_s` more than the other sensors' at the same instant.
    `turn_bias` (m,) at `bias_stamp_ns` (m,), held between them.
    """

    speed_scale: float
    turn_scale: float
    delay_s: float
    bias_stamp_ns: Ints
    turn_bias: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class DeadReckonedPath:
    """A path in a frame of its own. stamp_ns (n,); pose (n, 3): x, y in m, heading in rad, not wrapped;
    distance_m and turned_rad (n,): path length and sum of absolute heading changes since the start;
    sampling_m2 and sampling_rad2 (n,): variance of along-path position and heading since the start that
    comes from how coarsely speed and yaw rate were sampled."""

    stamp_ns: Ints
    pose: Floats
    distance_m: Floats
    turned_rad: Floats
    sampling_m2: Floats
    sampling_rad2: Floats

    def at(self, stamp_ns: Ints) -> Floats:
        """Poses (m, 3) at any stamps (m,), interpolated, held at the ends."""
        t_s = (self.stamp_ns - self.stamp_ns[0]) * 1e-9
        at_s = (stamp_ns - self.stamp_ns[0]) * 1e-9
        return np.column_stack([np.interp(at_s, t_s, self.pose[:, axis]) for axis in range(3)])

    def length_at(self, stamp_ns: Ints) -> Floats:
        """Path length (m,) in m since the start at any stamps (m,), interpolated, held at the ends."""
        start_ns = self.stamp_ns[0]
        length_m: Floats = np.interp((stamp_ns - start_ns) * 1e-9, (self.stamp_ns - start_ns) * 1e-9, self.distance_m)
        return length_m


@dataclass(frozen=True, slots=True, kw_only=True)
class Motions:
    """Motions between a drive's keyframes. stamp_ns (n,); delta (n-1, 3): x, y in m, heading in rad of the
    later keyframe in the earlier one's frame; derivative (n-1, 3, 4) by speed scale, turn scale, delay, turn bias;
    covariance (n-1, 3, 3); bias_index (n-1,) which turn bias acts."""

    stamp_ns: Ints
    delta: Floats
    derivative: Floats
    covariance: Floats
    bias_index: Ints
    path: DeadReckonedPath


def turn_source(drive: Drive) -> TurnSource:
    """The best yaw rate a drive has: IMU, else steering, else the wheels' own, else what was commanded: a yaw rate
    that comes with the speed though no track is known that it could be measured by."""
    if len(drive.imu.stamp_ns) > 1:
        return TurnSource.IMU
    if np.isfinite(drive.wheels.steering_rad).any():
        return TurnSource.STEERING
    if not np.isfinite(drive.wheels.yaw_rate_radps).any():
        return TurnSource.NONE
    if drive.described.track_m <= 0.0:
        return TurnSource.COMMAND
    return TurnSource.SAMPLED_WHEELS if coarsely_sampled(drive.wheels.stamp_ns) else TurnSource.WHEELS


def _held(values: Floats) -> Floats:
    """The values with gaps (NaN) filled by the last value before, 0 before the first."""
    index = np.where(np.isfinite(values), np.arange(len(values)), -1)
    index = np.maximum.accumulate(index)
    return np.where(index >= 0, values[np.maximum(index, 0)], 0.0)


def _imu_turn_rad(drive: Drive) -> Floats:
    """Measured heading change over each wheel interval (n-1,), from the IMU's yaw rate, held at the ends."""
    start_ns = drive.imu.stamp_ns[0]
    t_s = (drive.imu.stamp_ns - start_ns) * 1e-9
    rate = drive.imu.yaw_rate_radps
    heading = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t_s))])
    return np.diff(np.interp((drive.wheels.stamp_ns - start_ns) * 1e-9, t_s, heading))


def _mean_of_ends(values: Floats) -> Floats:
    """Trapezoidal mean (n-1,) over each interval of samples (n,)."""
    return 0.5 * (values[1:] + values[:-1])


def _turn_and_speed(drive: Drive, calibration: OdometryCalibration, dt_s: Floats) -> tuple[Floats, Floats]:
    """Heading change in rad and base speed in m/s of each wheel interval (n-1,)."""
    described, wheels = drive.described, drive.wheels
    index = np.searchsorted(calibration.bias_stamp_ns, wheels.stamp_ns[:-1], side="right") - 1
    bias = calibration.turn_bias[np.maximum(index, 0)]
    speed = calibration.speed_scale * _mean_of_ends(wheels.speed_mps)
    match turn_source(drive):
        case TurnSource.STEERING:
            angle = calibration.turn_scale * _mean_of_ends(_held(wheels.steering_rad)) + bias
            curvature = np.tan(np.clip(angle, -MAX_STEERING_RAD, MAX_STEERING_RAD)) / described.wheelbase_m
            base_speed = speed / np.maximum(1.0 - described.speed_wheel_y_m * curvature, 0.1)
            return base_speed * curvature * dt_s, base_speed
        case TurnSource.IMU:
            turn = calibration.turn_scale * _imu_turn_rad(drive) + bias * dt_s
        case TurnSource.WHEELS | TurnSource.COMMAND:
            turn = (calibration.turn_scale * _mean_of_ends(_held(wheels.yaw_rate_radps)) + bias * speed) * dt_s
        case TurnSource.SAMPLED_WHEELS:
            turn = _mean_of_ends(_sampled_yaw_rate(drive, calibration)) * dt_s
        case TurnSource.NONE:
            turn = bias * speed * dt_s
    yaw_rate = np.divide(turn, dt_s, out=np.zeros_like(turn), where=dt_s > 0.0)
    return turn, speed + described.speed_wheel_y_m * yaw_rate


def _sampled_yaw_rate(drive: Drive, calibration: OdometryCalibration) -> Floats:
    """Yaw rate (n,) in rad/s at each sample of coarsely sampled wheels, their wobble taken out."""
    wheels = drive.wheels
    index = np.searchsorted(calibration.bias_stamp_ns, wheels.stamp_ns, side="right") - 1
    bias = calibration.turn_bias[np.maximum(index, 0)]
    measured = _held(wheels.yaw_rate_radps)
    rate = calibration.turn_scale * measured + bias * calibration.speed_scale * wheels.speed_mps
    return without_wobble(rate, wobble_radps(measured, wheels.speed_mps))


def dead_reckon(drive: Drive, calibration: OdometryCalibration, *, max_gap_s: float) -> DeadReckonedPath:
    """The path the wheels and the turn source describe, from the origin at the first wheel stamp.

    Intervals longer than `max_gap_s` carry the last speed for `max_gap_s` only.
    """
    stamp_ns = drive.wheels.stamp_ns
    dt_s = np.minimum(np.diff(stamp_ns) * 1e-9, max_gap_s)
    turn_rad, speed_mps = _turn_and_speed(drive, calibration, dt_s)
    heading = np.concatenate([[0.0], np.cumsum(turn_rad)])
    middle = heading[:-1] + 0.5 * turn_rad
    step_m = speed_mps * dt_s
    coarse = turn_source(drive) is TurnSource.SAMPLED_WHEELS
    x = np.concatenate([[0.0], np.cumsum(step_m * np.cos(middle))])
    y = np.concatenate([[0.0], np.cumsum(step_m * np.sin(middle))])
    return DeadReckonedPath(
        stamp_ns=stamp_ns - round(calibration.delay_s * 1e9),
        pose=np.column_stack([x, y, heading]),
        distance_m=np.concatenate([[0.0], np.cumsum(np.abs(step_m))]),
        turned_rad=np.concatenate([[0.0], np.cumsum(np.abs(turn_rad))]),
        sampling_m2=sampled_speed_variance(step_m, dt_s) if coarse else _sampling_variance(step_m, dt_s),
        sampling_rad2=sampled_turn_variance(step_m, turn_rad, dt_s) if coarse else _sampling_variance(turn_rad, dt_s),
    )


def _sampling_variance(step: Floats, dt_s: Floats) -> Floats:
    """Variance (n,) accumulated since the start by integrating a sampled rate: a rate that changes by d between
    neighbouring samples may be aliased: its integral over dt is uncertain by d dt / sqrt(2), the spread of a sample."""
    rate = np.divide(step, dt_s, out=np.zeros_like(step), where=dt_s > 0.0)
    change = np.abs(np.diff(rate, prepend=rate[:1]))
    return np.concatenate([[0.0], np.cumsum((change * dt_s) ** 2 / 2.0)])


def keyframe_stamps(path: DeadReckonedPath, *, distance_m: float, turn_rad: float, moving_s: float) -> Ints:
    """Stamps (n,) at which the path has gone `distance_m` further or turned `turn_rad` more, or, where it is slow,
    has been in motion for `moving_s`; ends included."""
    dt_s, step_m = np.diff(path.stamp_ns) * 1e-9, np.diff(path.distance_m)
    by_path = step_m / distance_m + np.diff(path.turned_rad) / turn_rad
    by_time = np.where(step_m > MOVING_MPS * dt_s, dt_s / moving_s, 0.0)
    progress = np.concatenate([[0.0], np.cumsum(np.maximum(by_path, by_time))])
    bins = np.floor(progress).astype(np.int64)
    first = np.concatenate([[0], np.nonzero(np.diff(bins) > 0)[0] + 1, [len(bins) - 1]])
    stamps: Ints = path.stamp_ns[np.unique(first)]
    return stamps


def relative_poses(pose_from: Floats, pose_to: Floats) -> Floats:
    """Poses (n, 3) of `pose_to` in the frames of `pose_from`, headings wrapped."""
    c, s = np.cos(pose_from[:, 2]), np.sin(pose_from[:, 2])
    dx, dy = pose_to[:, 0] - pose_from[:, 0], pose_to[:, 1] - pose_from[:, 1]
    turned = wrap_angles_rad(pose_to[:, 2] - pose_from[:, 2])
    return np.column_stack([c * dx + s * dy, c * dy - s * dx, turned])


def _keyframe_deltas(drive: Drive, calibration: OdometryCalibration, stamp_ns: Ints, max_gap_s: float) -> Floats:
    pose = dead_reckon(drive, calibration, max_gap_s=max_gap_s).at(stamp_ns)
    return relative_poses(pose[:-1], pose[1:])


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryNoise:
    """Random part of odometry that calibration does not explain, growing with the path.

    1-sigma over one metre (times the square root of metres): along and across the path in m, heading in rad;
    `heading_rad_per_sqrt_s` grows with time (gyroscope noise); `turn_fraction` of each heading change is noise,
    and so are `along_fraction` and `across_fraction` of each distance; `*_m_per_sqrt_s` grow with time.
    """

    along_m: float
    across_m: float
    heading_rad: float
    heading_rad_per_sqrt_s: float
    turn_fraction: float
    floor_m: float
    floor_rad: float
    along_m_per_sqrt_s: float = 0.0
    across_m_per_sqrt_s: float = 0.0
    along_fraction: float = 0.0
    across_fraction: float = 0.0


def _covariances(path: DeadReckonedPath, stamp_ns: Ints, noise: OdometryNoise) -> Floats:
    t_s = (path.stamp_ns - path.stamp_ns[0]) * 1e-9
    at_s = (stamp_ns - path.stamp_ns[0]) * 1e-9
    metres = np.diff(np.interp(at_s, t_s, path.distance_m))
    turned = np.diff(np.interp(at_s, t_s, path.turned_rad))
    heading = noise.heading_rad**2 * metres + noise.heading_rad_per_sqrt_s**2 * np.diff(at_s)
    heading += (noise.turn_fraction * turned) ** 2 + noise.floor_rad**2
    heading += np.diff(np.interp(at_s, t_s, path.sampling_rad2))
    along = noise.along_m**2 * metres + noise.floor_m**2 + np.diff(np.interp(at_s, t_s, path.sampling_m2))
    along += noise.along_m_per_sqrt_s**2 * np.diff(at_s) + (noise.along_fraction * metres) ** 2
    across = noise.across_m**2 * metres + noise.floor_m**2
    across += noise.across_m_per_sqrt_s**2 * np.diff(at_s) + (noise.across_fraction * metres) ** 2
    covariance = np.zeros((len(metres), 3, 3))
    covariance[:, 0, 0] = along
    covariance[:, 1, 1] = across + heading * metres**2 / 3.0
    covariance[:, 2, 2] = heading
    covariance[:, 1, 2] = covariance[:, 2, 1] = heading * metres / 2.0
    return covariance


def keyframe_motions(
    drive: Drive, calibration: OdometryCalibration, stamp_ns: Ints, *, noise: OdometryNoise, max_gap_s: float
) -> Motions:
    """The motions between keyframes at `stamp_ns` (n,) with first derivatives by the calibration."""
    path = dead_reckon(drive, calibration, max_gap_s=max_gap_s)
    pose = path.at(stamp_ns)
    delta = relative_poses(pose[:-1], pose[1:])
    stepped = (
        (replace(calibration, speed_scale=calibration.speed_scale + SCALE_STEP), SCALE_STEP),
        (replace(calibration, turn_scale=calibration.turn_scale + SCALE_STEP), SCALE_STEP),
        (replace(calibration, delay_s=calibration.delay_s + DELAY_STEP_S), DELAY_STEP_S),
        (replace(calibration, turn_bias=calibration.turn_bias + BIAS_STEP), BIAS_STEP),
    )
    columns = []
    for other, step in stepped:
        change = _keyframe_deltas(drive, other, stamp_ns, max_gap_s) - delta
        change[:, 2] = wrap_angles_rad(change[:, 2])
        columns.append(change / step)
    index = np.searchsorted(calibration.bias_stamp_ns, stamp_ns[:-1], side="right") - 1
    return Motions(
        stamp_ns=stamp_ns,
        delta=delta,
        derivative=np.stack(columns, axis=2),
        covariance=_covariances(path, stamp_ns, noise),
        bias_index=np.maximum(index, 0),
        path=path,
    )
