"""What wheels and inertial unit say of a motion."""

import math

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.observed import ImuMeasured, WheelSpeedMeasured
from trigpoint_vehicle.core.campus_settings import ImuSettings, WheelSettings
from trigpoint_vehicle.core.correlated import gauss_markov
from trigpoint_vehicle.core.motion import Motion
from trigpoint_vehicle.core.recording import Timed

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def sampled_indices(motion: Motion, rate_hz: float) -> Ints:
    """The samples (n,) of a motion nearest to a sensor's regular instants."""
    step_s = float(motion.time_s[1] - motion.time_s[0])
    count = math.floor(float(motion.time_s[-1]) * rate_hz + 1e-9) + 1
    return np.rint(np.arange(count) / (rate_hz * step_s)).astype(np.int64)


def stamps_ns(motion: Motion, index: Ints, first_stamp_ns: int) -> Ints:
    """Stamps (n,) of a motion's samples."""
    return first_stamp_ns + np.rint(motion.time_s[index] * 1e9).astype(np.int64)


def _steering_rad(yaw_rate: Floats, speed: Floats, wheelbase_m: float) -> Floats:
    moving = speed > 0.1
    return np.where(moving, np.arctan2(wheelbase_m * yaw_rate, np.maximum(speed, 0.1)), 0.0)


def wheel_speeds(
    motion: Motion, settings: WheelSettings, *, wheelbase_m: float, first_stamp_ns: int, rng: np.random.Generator
) -> list[Timed]:
    """Wheel speeds with a scale error of the drive, slip correlated in time, and white noise; speed 0 is exact.

    `motion.speed_mps` must be over the ground, not over the grid.
    """
    index = sampled_indices(motion, settings.rate_hz)
    true_mps, count = motion.speed_mps[index], len(index)
    scale = 1.0 + rng.normal(0.0, settings.scale_sigma)
    step_s = 1.0 / settings.rate_hz
    slip = gauss_markov(count, 1, sigma=settings.slip_sigma, step_s=step_s, time_s=settings.slip_time_s, rng=rng)
    white = rng.normal(0.0, settings.white_mps, count) * (true_mps > 0.05)
    speed = true_mps * (scale + slip[:, 0]) + white
    steering = np.full(count, np.nan)
    if settings.reports_steering:
        exact = _steering_rad(motion.yaw_rate_radps[index], true_mps, wheelbase_m)
        bias = rng.normal(0.0, settings.steering_bias_sigma_rad)
        steering = exact + bias + rng.normal(0.0, settings.steering_white_rad, count)
    stamps = stamps_ns(motion, index, first_stamp_ns)
    return [
        (stamp, WheelSpeedMeasured(speed_mps=v, steering_rad=angle, yaw_rate_radps=math.nan))
        for stamp, v, angle in zip(stamps.tolist(), speed.tolist(), steering.tolist(), strict=True)
    ]


def imu_readings(
    motion: Motion, settings: ImuSettings, *, first_stamp_ns: int, rng: np.random.Generator
) -> list[Timed]:
    """Yaw rates with a bias that walks from a drawn beginning, and accelerations, all with white noise."""
    index = sampled_indices(motion, settings.rate_hz)
    count, step_s = len(index), 1.0 / settings.rate_hz
    walk = np.cumsum(rng.normal(0.0, settings.bias_walk_radps_per_sqrt_s * math.sqrt(step_s), count))
    bias = rng.normal(0.0, settings.bias_sigma_radps) + walk
    true_radps = motion.yaw_rate_radps[index]
    yaw_rate = true_radps + bias + rng.normal(0.0, settings.white_radps, count)
    shake = rng.normal(0.0, settings.acceleration_white_mps2, (count, 2))
    ahead = motion.acceleration_mps2[index] + shake[:, 0]
    left = motion.speed_mps[index] * true_radps + shake[:, 1]
    columns = zip(
        stamps_ns(motion, index, first_stamp_ns).tolist(),
        yaw_rate.tolist(),
        ahead.tolist(),
        left.tolist(),
        strict=True,
    )
    return [
        (stamp, ImuMeasured(yaw_rate_radps=w, acceleration_x_mps2=ax, acceleration_y_mps2=ay))
        for stamp, w, ax, ay in columns
    ]
