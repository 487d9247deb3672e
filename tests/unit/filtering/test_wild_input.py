"""Whatever comes in, covariances stay symmetric positive definite and numbers finite."""

import math
from dataclasses import replace

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from driven_paths.examples import START_NS
from trigpoint.events.observed import VehicleDescribed
from trigpoint.geodesy.poses import Pose2
from trigpoint.geodesy.positions import MapPosition
from trigpoint_filtering.core.estimator import Estimator, GnssNoise, pose_covariance, pose_covariances
from trigpoint_filtering.core.following import Track, started_track
from trigpoint_filtering.core.gate import Hypothesis
from trigpoint_filtering.core.initialisation import Alignment, placed, prior_calibration
from trigpoint_filtering.core.motion import Geometry, MotionStep, TurnSource
from trigpoint_filtering.core.online import after_fix, after_imu, after_wheel
from trigpoint_filtering.settings import FilterSettings

GEOMETRY = Geometry(2.5, 0.7, 1.5, 0.4, 1.0)
NOISE = GnssNoise(1.0, 2.0, 120.0)
DESCRIBED = VehicleDescribed(vehicle="car", wheelbase_m=2.5, antenna_x_m=1.5, speed_wheel_y_m=0.7)

ANY_STEP_S = st.sampled_from([-0.4, -0.1, 0.0, 0.02, 0.1, 1.0, 20.0, 4000.0])
ANY_SPEED = st.floats(-60.0, 60.0) | st.sampled_from([0.0, math.nan, math.inf])
ANY_TURN = st.floats(-8.0, 8.0) | st.sampled_from([0.0, math.nan])
ANY_PLACE = st.floats(-5e6, 5e6) | st.sampled_from([0.0, math.nan])
ANY_SIGMA = st.floats(0.0, 1e6) | st.sampled_from([math.nan, -1.0])

WHEEL = st.tuples(st.just("wheel"), ANY_STEP_S, ANY_SPEED, ANY_TURN)
IMU = st.tuples(st.just("imu"), ANY_STEP_S, ANY_TURN, st.none())
FIX = st.tuples(st.just("fix"), ANY_STEP_S, st.tuples(ANY_PLACE, ANY_PLACE), ANY_SIGMA)


def followed_track(source: TurnSource) -> Track:
    """A track that has its position already, at the map's origin."""
    track = started_track(DESCRIBED, boot_id="b", point_scale=1.0, settings=FilterSettings())
    track = after_wheel(track, 5.0, steering_rad=0.1, yaw_rate_radps=math.nan, stamp_ns=START_NS)
    track = after_wheel(track, 5.0, steering_rad=0.1, yaw_rate_radps=math.nan, stamp_ns=START_NS + 10**8)
    prior = prior_calibration(source, GEOMETRY, antenna_sigma_m=0.3)
    belief = placed(prior, Pose2(0.0, 0.0, 0.0), Alignment(Pose2(0.0, 0.0, 0.0), 0.3, 1.0, 6), NOISE)
    return replace(track, hypothesis=Hypothesis(belief, START_NS, START_NS), source=source)


def after_sample(track: Track, sample: tuple[str, float, object, object], stamp_ns: int, number: int) -> Track:
    kind, _, first, second = sample
    if kind == "wheel":
        return after_wheel(track, first, steering_rad=second, yaw_rate_radps=math.nan, stamp_ns=stamp_ns)  # type: ignore[arg-type]
    if kind == "imu":
        return after_imu(track, first, stamp_ns=stamp_ns)  # type: ignore[arg-type]
    return after_fix(track, MapPosition(*first), stamp_ns=stamp_ns, sigma_m=second, sequence=number)  # type: ignore[misc, arg-type]


def is_sound(track: Track) -> bool:
    if track.hypothesis is None:
        return True
    belief = track.hypothesis.belief
    whole, pose = belief.covariance, pose_covariance(belief.covariance)
    symmetric = np.array_equal(pose, pose.T) and np.allclose(whole, whole.T, rtol=1e-12)
    definite = np.linalg.eigvalsh(pose)[0] > 0.0 and bool(np.all(whole.diagonal() > 0.0))
    np.linalg.cholesky(whole)
    return symmetric and definite and bool(np.all(np.isfinite(belief.mean)))


@settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(WHEEL | IMU | FIX, min_size=1, max_size=25), st.sampled_from(list(TurnSource)))
def test_covariances_are_sound_after_any_samples(
    samples: list[tuple[str, float, object, object]], source: TurnSource
) -> None:
    track, stamp_ns = followed_track(source), START_NS + 10**8
    for number, sample in enumerate(samples):
        stamp_ns += round(sample[1] * 1e9)
        track = after_sample(track, sample, stamp_ns, number)
        assert is_sound(track), (number, sample)


def test_a_thousand_predictions_without_a_fix_stay_sound() -> None:
    estimator = Estimator(GEOMETRY)
    prior = prior_calibration(TurnSource.STEERING, GEOMETRY, antenna_sigma_m=0.3)
    belief = placed(prior, Pose2(0.0, 0.0, 0.0), Alignment(Pose2(0.0, 0.0, 0.0), 0.3, 1.0, 6), NOISE)
    step = MotionStep(1.0, 30.0, 0.05, TurnSource.STEERING)
    for _ in range(1000):
        belief = estimator.predicted(belief, step, NOISE)
    np.linalg.cholesky(belief.covariance)
    assert np.linalg.eigvalsh(pose_covariance(belief.covariance))[0] > 0.0


def test_a_thousand_perfect_fixes_leave_some_uncertainty() -> None:
    estimator = Estimator(GEOMETRY)
    prior = prior_calibration(TurnSource.IMU, GEOMETRY, antenna_sigma_m=0.3)
    belief = placed(prior, Pose2(0.0, 0.0, 0.0), Alignment(Pose2(0.0, 0.0, 0.0), 0.3, 1.0, 6), NOISE)
    for _ in range(1000):
        belief = estimator.corrected(belief, np.array([1.5, 0.4]), GnssNoise(1e-6, 1.0, 120.0)).belief
    np.linalg.cholesky(belief.covariance)
    assert np.linalg.eigvalsh(pose_covariance(belief.covariance))[0] > 0.0


def test_covariances_of_many_poses_are_mended_where_they_must_be() -> None:
    broken = np.diag([1.0, 1.0, -1e-6])
    mended = pose_covariances(np.stack([np.eye(3), broken]))
    np.testing.assert_array_equal(mended[0], np.eye(3))
    assert np.linalg.eigvalsh(mended[1])[0] > 0.0
