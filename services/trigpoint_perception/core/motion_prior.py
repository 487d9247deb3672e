"""How the base moved by its wheels and gyroscope: what a sweep is deskewed by before it is matched."""

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.drives import Drive
from trigpoint_perception.core.deskew import NS_PER_S, Path, planar_path

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

GAP_S = 1.0  # between two wheel samples: what happened there is not known
STEERING_LIMIT_RAD = 1.2  # the tangent stays bounded


def wheel_path(drive: Drive) -> Path | None:
    """The path by dead reckoning, in a frame of its own; None without wheels, a yaw rate, or with gaps over 1 s.

    The yaw rate is the IMU's where there is one, else the wheels' own, else the steering's.
    """
    wheels = drive.wheels
    stamp_ns, first = np.unique(wheels.stamp_ns, return_index=True)
    speed_mps = wheels.speed_mps[first]
    yaw_rate_radps = _yaw_rates(drive, stamp_ns, first)
    if len(stamp_ns) < 2 or yaw_rate_radps is None or not np.isfinite(speed_mps).all():
        return None
    step_s = np.diff(stamp_ns) / NS_PER_S
    if step_s.max() > GAP_S:
        return None
    turn = 0.5 * (yaw_rate_radps[1:] + yaw_rate_radps[:-1]) * step_s
    heading_rad = np.concatenate([[0.0], np.cumsum(turn)])
    middle_rad = heading_rad[:-1] + 0.5 * turn
    run_m = 0.5 * (speed_mps[1:] + speed_mps[:-1]) * step_s
    x_m = np.concatenate([[0.0], np.cumsum(run_m * np.cos(middle_rad))])
    y_m = np.concatenate([[0.0], np.cumsum(run_m * np.sin(middle_rad))])
    return planar_path(stamp_ns, np.column_stack([x_m, y_m, heading_rad]))


def _yaw_rates(drive: Drive, stamp_ns: Ints, row: Ints) -> Floats | None:
    """Yaw rates (n,) in rad/s at the wheels' stamps; None where nothing measures them."""
    imu, wheels = drive.imu, drive.wheels
    measured = np.isfinite(imu.yaw_rate_radps)
    if measured.any() and len(stamp_ns):
        t_s = (imu.stamp_ns[measured] - stamp_ns[0]) / NS_PER_S
        rates: Floats = np.interp((stamp_ns - stamp_ns[0]) / NS_PER_S, t_s, imu.yaw_rate_radps[measured])
        return rates
    own: Floats = wheels.yaw_rate_radps[row]
    if np.isfinite(own).all():
        return own
    steering_rad = np.clip(wheels.steering_rad[row], -STEERING_LIMIT_RAD, STEERING_LIMIT_RAD)
    if drive.described.wheelbase_m > 0.0 and np.isfinite(steering_rad).all():
        rates = wheels.speed_mps[row] * np.tan(steering_rad) / drive.described.wheelbase_m
        return rates
    return None
