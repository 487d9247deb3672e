"""Inputs become steps at a bounded rate, and steps move the base as geometry says."""

import math

import numpy as np
import pytest

from trigpoint_filtering.core.motion import (
    HEADING,
    SPEED_SCALE,
    TURN_SCALE,
    Geometry,
    MotionStep,
    TurnSource,
    X,
    Y,
    base_motion,
    moved,
)
from trigpoint_filtering.core.odometer import Odometer, after_imu_sample, after_wheel_sample, taken_step

SECOND_NS = 1_000_000_000


def state_at_origin() -> np.ndarray:
    state = np.zeros((1, 10))
    state[0, [SPEED_SCALE, TURN_SCALE]] = 1.0
    return state


def wheel(odometer: Odometer, speed_mps: float, at_s: float, *, steering_rad: float = math.nan) -> Odometer:
    return after_wheel_sample(
        odometer, speed_mps, steering_rad=steering_rad, yaw_rate_radps=math.nan, stamp_ns=round(at_s * SECOND_NS)
    )


def test_steering_turns_a_base_with_its_speed_wheel_on_the_inside() -> None:
    # Left turn of radius 10 m: the wheel 0.76 m left of the middle runs on 9.24 m, at 0.924 of the base's speed.
    geometry = Geometry(2.83, 0.76, 0.0, 0.0, 1.0)
    step = MotionStep(1.0, 9.24, math.atan(2.83 / 10.0), TurnSource.STEERING)
    speed_mps, yaw_rate_radps = base_motion(state_at_origin()[0], step, geometry)
    assert float(speed_mps) == pytest.approx(10.0)
    assert float(yaw_rate_radps) == pytest.approx(1.0)


def test_a_quarter_circle_ends_where_a_compass_says() -> None:
    # Radius 4 m, counter-clockwise from east: (4, 4), heading north.
    step = MotionStep(1.0, 2.0 * math.pi, 0.5 * math.pi, TurnSource.IMU)
    after = moved(state_at_origin(), step, Geometry(0.0, 0.0, 0.0, 0.0, 1.0), bias_time_s=1.0)[0]
    np.testing.assert_allclose(after[[X, Y, HEADING]], [4.0, 4.0, 0.5 * math.pi], atol=1e-9)


def test_ground_metres_become_map_metres_by_the_point_scale() -> None:
    step = MotionStep(1.0, 1000.0, 0.0, TurnSource.IMU)
    after = moved(state_at_origin(), step, Geometry(0.0, 0.0, 0.0, 0.0, 0.9996), bias_time_s=1.0)[0]
    assert after[X] == pytest.approx(999.6)


def test_a_step_holds_the_mean_of_its_samples() -> None:
    odometer = wheel(Odometer(True), 4.0, 10.0, steering_rad=0.1)
    odometer = wheel(odometer, 4.0, 10.1, steering_rad=0.1)
    odometer = wheel(odometer, 7.0, 10.3, steering_rad=0.4)
    step, after = taken_step(odometer)
    assert step is not None
    assert (step.dt_s, step.speed_mps, step.turn) == pytest.approx((0.3, 6.0, 0.3))
    assert after.pending.s == 0.0


def test_the_imu_is_preferred_to_steering_while_it_speaks() -> None:
    odometer = wheel(Odometer(True), 4.0, 10.0, steering_rad=0.1)
    odometer = after_imu_sample(odometer, 0.2, stamp_ns=round(10.1 * SECOND_NS))
    step, odometer = taken_step(wheel(odometer, 4.0, 10.2, steering_rad=0.1))
    assert step is not None
    assert step.source is TurnSource.IMU


def test_steering_takes_over_when_the_imu_falls_silent() -> None:
    odometer = after_imu_sample(wheel(Odometer(True), 4.0, 10.0), 0.2, stamp_ns=round(10.1 * SECOND_NS))
    _, odometer = taken_step(wheel(odometer, 4.0, 10.2, steering_rad=0.1))
    step, _ = taken_step(wheel(odometer, 4.0, 12.0, steering_rad=0.1))
    assert step is not None
    assert step.source is TurnSource.STEERING
    assert step.turn == pytest.approx(0.1)


def test_time_without_wheel_samples_counts_as_blind() -> None:
    odometer = after_imu_sample(wheel(Odometer(True), 4.0, 10.0), 0.2, stamp_ns=10 * SECOND_NS)
    step, _ = taken_step(wheel(odometer, 4.0, 15.0, steering_rad=0.1))
    assert step is not None
    assert step.blind_s == pytest.approx(3.5)  # 5 s less the 1.5 s that slow wheels may take


def test_a_sample_from_the_past_adds_no_motion() -> None:
    odometer = wheel(wheel(Odometer(True), 4.0, 10.0, steering_rad=0.0), 4.0, 10.1, steering_rad=0.0)
    assert wheel(odometer, 9.0, 10.05, steering_rad=0.0).pending == odometer.pending


def test_a_speed_that_is_no_number_is_passed_over() -> None:
    odometer = wheel(Odometer(True), 4.0, 10.0)
    assert wheel(odometer, math.nan, 10.1) is odometer


def test_a_vehicle_at_rest_does_not_turn_by_its_gyroscopes_bias() -> None:
    odometer = after_imu_sample(wheel(Odometer(False), 0.0, 10.0), 0.01, stamp_ns=10 * SECOND_NS)
    step, _ = taken_step(after_imu_sample(odometer, 0.01, stamp_ns=11 * SECOND_NS))
    assert step is not None
    _, yaw_rate_radps = base_motion(state_at_origin(), step, Geometry(0.0, 0.0, 0.0, 0.0, 1.0))
    assert yaw_rate_radps[0] == 0.0
