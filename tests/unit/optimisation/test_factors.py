"""Every factor's residual is what it claims, and its Jacobians are its derivatives."""

import math

import gtsam
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from solved_worlds.derivatives import assert_derivatives, values_of
from trigpoint_optimisation.core.factors import anchor_factor, decay_factor, fix_factor, odometry_factor

Floats = NDArray[np.float64]

METRES = st.floats(-100.0, 100.0)
HEADINGS = st.floats(-math.pi, math.pi)
POSES = st.tuples(METRES, METRES, HEADINGS)
SYDNEY = (333_512.25, 6_248_731.125)  # m, UTM zone 56: exact in float64, 0.5 m steps in float32


def unit(size: int) -> gtsam.noiseModel.Base:
    return gtsam.noiseModel.Unit.Create(size)


def an_odometry_factor(covariance: Floats) -> gtsam.CustomFactor:
    derivative = np.array([[1.9, 0.1, 0.4, -2.0], [0.05, 0.2, 0.1, 1.1], [0.02, 0.3, -0.2, 0.7]])
    reference = np.array([1.01, 0.97, 0.02, 0.004])
    return odometry_factor(
        (0, 1, 2, 3), np.array([2.0, 0.1, 0.2]), derivative, reference=reference, covariance=covariance
    )


def a_fix_factor(fix_m: Floats, *, sigma_m: float = 1.0) -> gtsam.CustomFactor:
    return fix_factor(
        (0, 1, 2, 3),
        fix_m,
        T_keyframe_base=np.array([0.8, 0.1, 0.05]),
        bias_weight=(0.3, 0.7),
        noise=gtsam.noiseModel.Isotropic.Sigma(2, sigma_m),
    )


@settings(max_examples=25, deadline=None)
@given(POSES, st.floats(-3.0, 3.0), st.floats(0.8, 1.2), st.floats(-0.05, 0.05))
def test_the_odometry_factor_has_the_derivatives_it_says(
    start: tuple[float, float, float], turned_rad: float, scale: float, bias: float
) -> None:
    end = gtsam.Pose2(start[0] + 1.9, start[1] - 0.4, start[2] + 0.2 + 0.9 * turned_rad)
    values = values_of(gtsam.Pose2(*start), end, np.array([scale, 2.0 - scale, 0.03]), np.array([bias]))
    assert_derivatives(an_odometry_factor(np.eye(3)), values, (3, 3, 3, 1))


@settings(max_examples=25, deadline=None)
@given(POSES, METRES, METRES)
def test_the_fix_factor_has_the_derivatives_it_says(pose: tuple[float, float, float], x_m: float, y_m: float) -> None:
    values = values_of(gtsam.Pose2(*pose), np.array([1.5, 0.4]), np.array([x_m, 1.0]), np.array([0.5, y_m]))
    assert_derivatives(a_fix_factor(np.array([x_m, y_m])), values, (3, 2, 2, 2))


def test_the_decay_factor_has_the_derivatives_it_says() -> None:
    factor = decay_factor(0, 1, decay=0.7, sigma_m=1.0, size=2)
    assert_derivatives(factor, values_of(np.array([1.0, -2.0]), np.array([0.3, 0.1])), (2, 2))


def test_the_anchor_factor_has_the_derivatives_it_says() -> None:
    factor = anchor_factor((0, 1), np.array([10.0, 20.0]), noise=unit(2))
    assert_derivatives(factor, values_of(np.array([9.0, 21.0]), np.array([0.3, 0.1])), (2, 2))


def test_odometry_at_its_own_calibration_and_motion_costs_nothing() -> None:
    start = gtsam.Pose2(5.0, -3.0, 3.1)
    end = start.compose(gtsam.Pose2(2.0, 0.1, 0.2))  # past +pi: the residual is of wrapped headings
    values = values_of(start, end, np.array([1.01, 0.97, 0.02]), np.array([0.004]))
    assert an_odometry_factor(np.eye(3)).error(values) == pytest.approx(0.0, abs=1e-20)  # rounding, squared


def test_the_antenna_is_where_its_lever_arm_says() -> None:
    # Base at (10, 20) heading north when the keyframe is there too: 3 m ahead is north, 1 m left is west.
    factor = fix_factor((0, 1), np.zeros(2), T_keyframe_base=np.zeros(3), bias_weight=(0.0, 0.0), noise=unit(2))
    values = values_of(gtsam.Pose2(10.0, 20.0, math.pi / 2), np.array([3.0, 1.0]))
    assert factor.unwhitenedError(values) == pytest.approx((9.0, 23.0))


def test_a_fix_between_keyframes_is_held_against_where_the_base_was_then() -> None:
    factor = fix_factor(
        (0, 1), np.zeros(2), T_keyframe_base=np.array([1.0, 0.0, math.pi / 2]), bias_weight=(0.0, 0.0), noise=unit(2)
    )
    values = values_of(gtsam.Pose2(0.0, 0.0, 0.0), np.array([3.0, 0.0]))
    assert factor.unwhitenedError(values) == pytest.approx((1.0, 3.0))


def test_the_slow_error_of_a_fix_is_taken_between_its_knots() -> None:
    values = values_of(gtsam.Pose2(0.0, 0.0, 0.0), np.zeros(2), np.array([10.0, 0.0]), np.array([0.0, 10.0]))
    without = values_of(gtsam.Pose2(0.0, 0.0, 0.0), np.zeros(2), np.zeros(2), np.zeros(2))
    factor = a_fix_factor(np.zeros(2))
    assert factor.unwhitenedError(values) - factor.unwhitenedError(without) == pytest.approx((3.0, 7.0))


def test_doubling_sigma_quarters_the_cost_of_a_fix() -> None:
    values = values_of(gtsam.Pose2(0.0, 0.0, 0.0), np.zeros(2), np.zeros(2), np.zeros(2))
    once, twice = a_fix_factor(np.array([4.0, -3.0])), a_fix_factor(np.array([4.0, -3.0]), sigma_m=2.0)
    assert twice.error(values) == pytest.approx(once.error(values) / 4.0)


def test_doubling_sigma_quarters_the_cost_of_odometry() -> None:
    values = values_of(gtsam.Pose2(), gtsam.Pose2(1.0, 0.5, 0.1), np.array([1.0, 1.0, 0.0]), np.zeros(1))
    once, twice = an_odometry_factor(0.01 * np.eye(3)), an_odometry_factor(0.04 * np.eye(3))
    assert twice.error(values) == pytest.approx(once.error(values) / 4.0)


def test_doubling_sigma_quarters_the_cost_of_an_anchor() -> None:
    values = values_of(np.array([9.0, 21.0]), np.array([0.3, 0.1]))
    label_m = np.array([10.0, 20.0])
    once = anchor_factor((0, 1), label_m, noise=gtsam.noiseModel.Isotropic.Sigma(2, 0.1))
    twice = anchor_factor((0, 1), label_m, noise=gtsam.noiseModel.Isotropic.Sigma(2, 0.2))
    assert twice.error(values) == pytest.approx(once.error(values) / 4.0)


def test_a_slow_error_keeps_the_variance_it_claims() -> None:
    # A Gauss-Markov step of decay a and noise sqrt(1 - a^2) s has standard deviation s before and after.
    decay, sigma_m = 0.6, 2.5
    graph = gtsam.NonlinearFactorGraph()
    graph.add(gtsam.PriorFactorVector(0, np.zeros(2), gtsam.noiseModel.Isotropic.Sigma(2, sigma_m)))
    graph.add(decay_factor(0, 1, decay=decay, sigma_m=sigma_m * math.sqrt(1.0 - decay**2), size=2))
    covariance = gtsam.Marginals(graph, values_of(np.zeros(2), np.zeros(2))).marginalCovariance(1)
    np.testing.assert_allclose(covariance, sigma_m**2 * np.eye(2), rtol=1e-9)  # rounding


def test_a_millimetre_counts_at_sydneys_northing() -> None:
    factor = anchor_factor((0,), np.array(SYDNEY), noise=unit(2))
    values = values_of(np.array(SYDNEY) + (0.001, -0.001))
    assert factor.unwhitenedError(values) == pytest.approx((0.001, -0.001), abs=1e-8)  # m, float64 steps of 1e-9


def test_a_fix_moves_the_pose_at_sydneys_northing_too() -> None:
    # Translation is what it must pull: the whole metre, to the micrometre.
    graph, values = gtsam.NonlinearFactorGraph(), values_of(gtsam.Pose2(*SYDNEY, 0.3), np.zeros(2))
    graph.add(
        fix_factor(
            (0, 1),
            np.array(SYDNEY) + (0.6, 0.8),
            T_keyframe_base=np.zeros(3),
            bias_weight=(0.0, 0.0),
            noise=gtsam.noiseModel.Isotropic.Sigma(2, 1e-3),
        )
    )
    graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*SYDNEY, 0.3), gtsam.noiseModel.Isotropic.Sigma(3, 1e3)))
    graph.add(gtsam.PriorFactorVector(1, np.zeros(2), gtsam.noiseModel.Isotropic.Sigma(2, 1e-6)))
    solved = gtsam.GaussNewtonOptimizer(graph, values).optimize().atPose2(0)
    assert (solved.x() - SYDNEY[0], solved.y() - SYDNEY[1]) == pytest.approx((0.6, 0.8), abs=1e-6)  # m
