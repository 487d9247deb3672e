"""How a vehicle moves between two stamps: inputs averaged over steps, and the state they carry forward.

State (10,): x, y in m, heading in rad (not wrapped, so that sigma points average plainly), speed scale,
turn scale, turn bias, antenna x, y in m in the base frame, GNSS bias x, y in m in the map frame.
"""

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.observed import VehicleDescribed

Floats = NDArray[np.float64]

X, Y, HEADING, SPEED_SCALE, TURN_SCALE, TURN_BIAS, ANTENNA_X, ANTENNA_Y, BIAS_X, BIAS_Y = range(10)
STATE_SIZE = 10

TINY_RAD = 1e-12  # keeps sin(angle) / angle defined on straights
MAX_STEERING_RAD = 1.2  # beyond any road vehicle's lock; keeps the tangent tame
MIN_WHEEL_RATIO = 0.2  # of the base's speed at the speed wheel: a tighter turn is not believed


class TurnSource(Enum):
    """What tells how fast the heading changes; the turn bias is in rad/s, rad and rad/m respectively."""

    IMU = "imu"
    STEERING = "steering"
    WHEELS = "wheels"


@dataclass(frozen=True, slots=True)
class TurnNoise:
    """Uncertainty of a turn source: prior sigmas of scale and bias, their walks, and noise of the heading.

    Walks are per square root of a second; heading noise per root second, per root metre, and as a share of
    the angle turned.
    """

    scale_sigma: float
    bias_sigma: float
    bias_walk: float
    heading_per_root_s: float
    heading_per_root_m: float
    heading_share: float


# Tuned on Victoria Park (steering), NCLT (wheels at 1 Hz) and the simulated campus (MEMS gyroscope).
TURN_NOISE = {
    TurnSource.IMU: TurnNoise(0.003, 0.01, 1e-4, 0.001, 0.0005, 0.003),
    TurnSource.STEERING: TurnNoise(0.08, 0.02, 2e-4, 0.0, 0.015, 0.02),
    TurnSource.WHEELS: TurnNoise(0.1, 0.01, 1e-4, 0.002, 0.01, 0.05),
}
SPEED_SCALE_SIGMA = 0.05  # of the nominal wheel radius: wear, load, pressure
SPEED_SCALE_WALK = 1e-4  # per root second: tyres warm up, surfaces change
POSITION_PER_ROOT_M = 0.05  # m per root metre driven: slip and side-slip
POSITION_PER_ROOT_S = 0.003  # m per root second: nothing is known better than this


@dataclass(frozen=True, slots=True)
class MotionStep:
    """Inputs averaged over `dt_s` seconds: measured speed in m/s, and turn in the unit of its source.

    `blind_s` of it went by without a fresh wheel sample, `longest_s` between two samples at most;
    `standing` when nothing turned or rolled.
    """

    dt_s: float
    speed_mps: float
    turn: float
    source: TurnSource
    blind_s: float = 0.0
    longest_s: float = 0.0
    standing: bool = False


@dataclass(frozen=True, slots=True)
class Geometry:
    """What of a vehicle's description bears on its motion, in metres; `point_scale` is map metres a ground metre."""

    wheelbase_m: float
    speed_wheel_y_m: float
    antenna_x_m: float
    antenna_y_m: float
    point_scale: float


def geometry_of(described: VehicleDescribed, *, point_scale: float) -> Geometry:
    """The geometry of a described vehicle in a map of `point_scale`."""
    return Geometry(
        described.wheelbase_m,
        described.speed_wheel_y_m,
        described.antenna_x_m,
        described.antenna_y_m,
        point_scale,
    )


def base_motion(state: Floats, step: MotionStep, geometry: Geometry) -> tuple[Floats, Floats]:
    """Speed of the base in m/s and yaw rate in rad/s, (n,) each, for states (n, 10), or one of each for (10,).

    A wheel at y to the left of the base runs at v - yaw rate * y; steering by Ackermann, tan(angle) / wheelbase.
    """
    if step.standing:
        return np.zeros(state.shape[:-1]), np.zeros(state.shape[:-1])
    speed_mps = state[..., SPEED_SCALE] * step.speed_mps
    turn = state[..., TURN_SCALE] * step.turn
    if step.source is TurnSource.STEERING:
        angle_rad = np.clip(turn + state[..., TURN_BIAS], -MAX_STEERING_RAD, MAX_STEERING_RAD)
        curvature = np.tan(angle_rad) / geometry.wheelbase_m
        base_mps = speed_mps / np.maximum(1.0 - curvature * geometry.speed_wheel_y_m, MIN_WHEEL_RATIO)
        return base_mps, base_mps * curvature
    bias = state[..., TURN_BIAS] * (step.speed_mps if step.source is TurnSource.WHEELS else 1.0)
    yaw_rate_radps = turn + bias
    return speed_mps + yaw_rate_radps * geometry.speed_wheel_y_m, yaw_rate_radps


def moved(state: Floats, step: MotionStep, geometry: Geometry, *, bias_time_s: float) -> Floats:
    """States (n, 10) after a step: an arc of constant speed and yaw rate; the GNSS bias decays."""
    speed_mps, yaw_rate_radps = base_motion(state, step, geometry)
    turned_rad = yaw_rate_radps * step.dt_s
    half_rad = 0.5 * turned_rad + TINY_RAD
    chord_m = speed_mps * (step.dt_s * geometry.point_scale) * np.sin(half_rad) / half_rad
    middle_rad = state[:, HEADING] + half_rad
    after = state.copy()
    after[:, X] += chord_m * np.cos(middle_rad)
    after[:, Y] += chord_m * np.sin(middle_rad)
    after[:, HEADING] += turned_rad
    after[:, BIAS_X:] *= math.exp(-step.dt_s / bias_time_s)
    return after


# Speed and yaw rate change between samples: errors of a step sampled once a second (NCLT's wheels at 1 Hz
# against truth: 0.2 m and 0.09 rad), growing with the interval to the power 3/2.
SAMPLING_M = 0.2
SAMPLING_RAD = 0.08
BLIND_M_PER_ROOT_S = 20.0  # position walk while nothing is heard from the wheels: 15 m/s kept for some 2 s
BLIND_RAD_PER_ROOT_S = 0.1


def _nominal_turn_rad(step: MotionStep, geometry: Geometry) -> float:
    if step.source is not TurnSource.STEERING:
        return step.turn * step.dt_s
    angle_rad = min(max(step.turn, -MAX_STEERING_RAD), MAX_STEERING_RAD)
    return step.speed_mps * step.dt_s * math.tan(angle_rad) / geometry.wheelbase_m


def step_variance(step: MotionStep, geometry: Geometry, *, gnss_bias_sigma_m: float, bias_time_s: float) -> Floats:
    """Variances (10,) that a step adds to the state."""
    noise = TURN_NOISE[step.source]
    turned_rad = _nominal_turn_rad(step, geometry)
    distance_m = abs(step.speed_mps) * step.dt_s
    sampling = 0.0 if step.standing else min(step.longest_s, 1.0) ** 2 * step.dt_s
    variance = np.zeros(STATE_SIZE)
    variance[X] = variance[Y] = (
        POSITION_PER_ROOT_S**2 * step.dt_s
        + POSITION_PER_ROOT_M**2 * distance_m
        + SAMPLING_M**2 * sampling
        + BLIND_M_PER_ROOT_S**2 * step.blind_s
    )
    variance[HEADING] = (
        noise.heading_per_root_s**2 * step.dt_s
        + noise.heading_per_root_m**2 * distance_m
        + (noise.heading_share * turned_rad) ** 2
        + SAMPLING_RAD**2 * sampling
        + BLIND_RAD_PER_ROOT_S**2 * step.blind_s
    )
    variance[SPEED_SCALE] = SPEED_SCALE_WALK**2 * step.dt_s
    variance[TURN_SCALE] = 1e-14
    variance[TURN_BIAS] = noise.bias_walk**2 * step.dt_s
    variance[ANTENNA_X : ANTENNA_Y + 1] = 1e-14
    variance[BIAS_X:] = gnss_bias_sigma_m**2 * (1.0 - math.exp(-2.0 * step.dt_s / bias_time_s)) + 1e-14
    return variance
