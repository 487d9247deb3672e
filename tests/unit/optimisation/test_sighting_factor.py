"""A sighting through a sensor with calibration: its residual by hand, its Jacobians by differences."""

import math

import gtsam
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from solved_worlds.derivatives import assert_derivatives, values_of
from trigpoint_optimisation.core.factors import Measured, sighting_factor

Floats = NDArray[np.float64]

METRES = st.floats(-20.0, 20.0)
POSES = st.tuples(METRES, METRES, st.floats(-math.pi, math.pi))
MOUNT = np.array([0.3, -0.1, 0.2])  # the sensor in its keyframe's frame
SENSOR = np.array([0.02, -0.03, 0.1, 0.05, 0.01, -0.02])


def sighting(*, bearing_rad: float, target_m: Floats | None = None, sigma: float = 1.0) -> gtsam.CustomFactor:
    measured = Measured(
        ln_range=1.2,
        bearing_rad=bearing_rad,
        centred_square_rad2=bearing_rad**2 - 0.04,
        T_keyframe_sensor=MOUNT,
        target_m=target_m,
    )
    return sighting_factor((0, 1, 2), measured, noise=gtsam.noiseModel.Isotropic.Sigma(2, sigma))


def seen_from(pose: tuple[float, float, float], point_m: Floats) -> Floats:
    """The point (2,) in the sensor's own frame, its calibration known."""
    sensor = gtsam.Pose2(*pose).compose(gtsam.Pose2(*MOUNT))
    seen: Floats = sensor.transformTo(point_m) - np.array([SENSOR[3], 0.0])
    return seen


@settings(max_examples=40, deadline=None)
@given(POSES, METRES, METRES)
def test_a_landmarks_sighting_has_the_derivatives_it_says(
    pose: tuple[float, float, float], x_m: float, y_m: float
) -> None:
    x, y = seen_from(pose, np.array([x_m, y_m]))
    assume(math.hypot(x, y) > 1.0)  # nearer, its derivatives grow without bound
    factor = sighting(bearing_rad=math.atan2(y, x) + 0.1)  # 0.1 rad off: far from where angles wrap
    assert_derivatives(factor, values_of(gtsam.Pose2(*pose), SENSOR, np.array([x_m, y_m])), (3, 6, 2))


@settings(max_examples=40, deadline=None)
@given(POSES, POSES)
def test_another_vehicles_sighting_has_the_derivatives_it_says(
    pose: tuple[float, float, float], seen: tuple[float, float, float]
) -> None:
    target_m = np.array([0.4, -0.2])
    x, y = seen_from(pose, gtsam.Pose2(*seen).transformFrom(target_m))
    assume(math.hypot(x, y) > 1.0)  # nearer, its derivatives grow without bound
    factor = sighting(bearing_rad=math.atan2(y, x) + 0.1, target_m=target_m)
    assert_derivatives(factor, values_of(gtsam.Pose2(*pose), SENSOR, gtsam.Pose2(*seen)), (3, 6, 3))


def test_a_landmark_straight_ahead_is_at_its_distance_and_at_no_bearing() -> None:
    # Keyframe at the origin heading north; the sensor 0.3 m ahead and 0.1 m right, looking 0.2 rad left of ahead.
    ray = math.pi / 2 + 0.2
    point_m = np.array([0.1, 0.3]) + math.exp(1.2) * np.array([math.cos(ray), math.sin(ray)])
    values = values_of(gtsam.Pose2(0.0, 0.0, math.pi / 2), np.zeros(6), point_m)
    assert sighting(bearing_rad=0.0).unwhitenedError(values) == pytest.approx((0.0, 0.0), abs=1e-12)  # rounding


def test_a_twice_as_distant_landmark_is_off_by_the_logarithm_of_two() -> None:
    ray = 0.2
    point_m = MOUNT[:2] + 2.0 * math.exp(1.2) * np.array([math.cos(ray), math.sin(ray)])
    values = values_of(gtsam.Pose2(), np.zeros(6), point_m)
    assert sighting(bearing_rad=0.0).unwhitenedError(values) == pytest.approx((math.log(2.0), 0.0), abs=1e-12)


def test_a_bearing_behind_does_not_jump_by_a_turn() -> None:
    point_m = MOUNT[:2] + 3.0 * np.array([math.cos(math.pi + 0.2 + 0.01), math.sin(math.pi + 0.2 + 0.01)])
    values = values_of(gtsam.Pose2(), np.zeros(6), point_m)
    assert sighting(bearing_rad=math.pi - 0.01).unwhitenedError(values)[1] == pytest.approx(0.02)


def test_doubling_sigma_quarters_the_cost_of_a_sighting() -> None:
    values = values_of(gtsam.Pose2(), np.zeros(6), np.array([5.0, 2.0]))
    once, twice = sighting(bearing_rad=0.3), sighting(bearing_rad=0.3, sigma=2.0)
    assert twice.error(values) == pytest.approx(once.error(values) / 4.0)


def test_a_landmark_at_the_sensor_itself_costs_something_finite() -> None:
    factor = sighting(bearing_rad=0.0)
    values = values_of(gtsam.Pose2(), np.zeros(6), MOUNT[:2])
    analytic, _ = factor.linearize(values).jacobian()
    assert np.isfinite(analytic).all()
    assert math.isfinite(factor.error(values))
