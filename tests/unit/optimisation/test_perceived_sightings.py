"""Landmarks found in points: as sure as perception says, never surer by being seen often, and off in range alike."""

import math

import gtsam
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from driven_paths.examples import FRAME, Course, driven
from solved_worlds.derivatives import assert_derivatives, values_of
from trigpoint.events.drives import DetectionSeries, Drive
from trigpoint_optimisation.core.detection_noise import DetectionNoise
from trigpoint_optimisation.core.factors import point_factor
from trigpoint_optimisation.core.graph import add_sightings
from trigpoint_optimisation.core.preparation import PreparedDrive, nominal_calibration, prepared_drive
from trigpoint_optimisation.core.sightings import Averaging, Sightings, drive_sightings
from trigpoint_optimisation.core.state import landmark_key, pose_key, range_offset_key, track_key
from trigpoint_optimisation.settings import Kernel, OdometrySettings, SolveSettings

Floats = NDArray[np.float64]

SETTINGS = SolveSettings(odometry=OdometrySettings(keyframe_m=6.0))
WORLD = driven(Course(duration_s=20.0))
NOISE = DetectionNoise(range_sigma_m=0.1, bearing_sigma_rad=0.005, common_sigma_m=0.05)
AVERAGING = Averaging(point_scale=1.0, noise=NOISE, shared_share=0.5)
TOLD_M2 = np.array([[0.02, 0.005], [0.005, 0.01]])
KNOWN = 1e-6  # sigma of what a test holds
METRES = st.floats(-20.0, 20.0)


def with_detections(*, kind: str = "pole") -> PreparedDrive:
    """A drive that saw one thing ten times a second, straight ahead, and was told how well."""
    stamp_ns = WORLD.drive.wheels.stamp_ns[0] + np.arange(1, 100, dtype=np.int64) * 100_000_000
    count = len(stamp_ns)
    series = DetectionSeries(
        stamp_ns=stamp_ns,
        range_m=np.full(count, 10.0),
        bearing_rad=np.zeros(count),
        diameter_m=np.full(count, 0.2),
        kind=(kind,) * count,
        signature=("",) * count,
        sequence=np.arange(count, dtype=np.int64),
        covariance_m2=np.repeat(TOLD_M2[None], count, axis=0),
    )
    names = ("vehicle", "boot_id", "described", "wheels", "imu", "fixes")
    drive = Drive(**{name: getattr(WORLD.drive, name) for name in names}, detections=series)
    calibration = nominal_calibration(drive, SETTINGS.calibration, point_scale=1.0)
    return prepared_drive(drive, FRAME, SETTINGS, index=0, calibration=calibration)


@pytest.fixture(scope="module")
def seen() -> Sightings:
    prepared = with_detections()
    return drive_sightings(prepared, np.zeros(len(prepared.detection_keyframe), dtype=np.int64), AVERAGING)


def test_a_keyframes_mean_is_no_surer_than_one_sight(seen: Sightings) -> None:
    trace_m2 = np.trace(seen.covariance, axis1=1, axis2=2) + 2.0 * seen.shared_m2
    assert trace_m2 == pytest.approx(np.trace(TOLD_M2))  # about eight sights a keyframe


def test_half_of_what_is_told_is_shared_by_all_sights_of_a_pass(seen: Sightings) -> None:
    assert seen.shared_m2 == pytest.approx(0.5 * 0.5 * np.trace(TOLD_M2))


@pytest.mark.parametrize(("kind", "column"), [("pole", 0), ("corner", 1)])
def test_each_kind_of_thing_has_its_range_offset(kind: str, column: int) -> None:
    prepared = with_detections(kind=kind)
    seen = drive_sightings(prepared, np.zeros(len(prepared.detection_keyframe), dtype=np.int64), AVERAGING)
    length = np.hypot(seen.by_offset[:, 0], seen.by_offset[:, 1])
    assert length[:, column] == pytest.approx(1.0, abs=0.01)  # the mean of rays a few degrees apart
    assert length[:, 1 - column] == pytest.approx(0.0)


def looked_at(point_m: Floats, *, times: int, too_far_m: float = 0.0) -> Sightings:
    """A track seen so often from keyframes 0, 1, ... at `standpoint`s, sigma 0.1 m each and 0.2 m of them all."""
    ray = np.array([point_m - standpoint(k) for k in range(times)])
    ray /= np.hypot(*ray.T)[:, None]
    return Sightings(
        drive=np.zeros(times, dtype=np.int64),
        keyframe=np.arange(times, dtype=np.int64),
        track=np.zeros(times, dtype=np.int64),
        point_m=np.array([point_m - standpoint(k) for k in range(times)]) + too_far_m * ray,
        covariance=np.repeat(0.1**2 * np.eye(2)[None], times, axis=0),
        shared_m2=np.full(times, 0.2**2),
        by_offset=np.stack([ray, np.zeros_like(ray)], axis=-1),
    )


def standpoint(keyframe: int) -> Floats:
    """Where a keyframe is (2,), heading east: along the street past everything."""
    return np.array([2.0 * keyframe, 0.0])


def standing(keyframe: int) -> gtsam.Pose2:
    """A keyframe's pose."""
    x_m, y_m = standpoint(keyframe)
    return gtsam.Pose2(x_m, y_m, 0.0)


def solved(sightings: Sightings, landmark: int, *, offset_sigma_m: float) -> tuple[gtsam.Marginals, gtsam.Values]:
    """The marginals and values of landmark, track and offset under known keyframes."""
    graph, start = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for k in sightings.keyframe:
        pose = standing(int(k))
        start.insert(pose_key(0, int(k)), pose)
        graph.add(gtsam.PriorFactorPose2(pose_key(0, int(k)), pose, gtsam.noiseModel.Isotropic.Sigma(3, KNOWN)))
    for key in (landmark_key(landmark), track_key(0), range_offset_key(0)):
        start.insert(key, np.zeros(2))
    prior = gtsam.noiseModel.Isotropic.Sigma(2, offset_sigma_m)
    graph.add(gtsam.PriorFactorVector(range_offset_key(0), np.zeros(2), prior))
    add_sightings(graph, sightings, np.full(len(sightings.track), landmark), kernel=None)
    values = gtsam.LevenbergMarquardtOptimizer(graph, start).optimize()
    return gtsam.Marginals(graph, values), values


@pytest.mark.parametrize("times", [1, 10, 40])
def test_a_landmark_seen_often_is_no_surer_than_the_error_all_sights_share(times: int) -> None:
    marginals, _ = solved(looked_at(np.array([20.0, 6.0]), times=times), 3, offset_sigma_m=KNOWN)
    variance_m2 = marginals.marginalCovariance(landmark_key(3))[0, 0]
    assert variance_m2 == pytest.approx(0.2**2 + 0.1**2 / times, rel=1e-3)


def test_passing_by_tells_how_much_too_far_things_seem() -> None:
    _, values = solved(looked_at(np.array([20.0, 6.0]), times=20, too_far_m=-0.05), 3, offset_sigma_m=1.0)
    assert values.atVector(range_offset_key(0))[0] == pytest.approx(
        -0.05, abs=1e-4
    )  # m: the prior holds it by a thousandth
    assert values.atPoint2(landmark_key(3)) == pytest.approx(np.array([20.0, 6.0]), abs=1e-3)


def test_a_pass_of_something_else_lets_its_landmark_go_under_a_kernel() -> None:
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    sightings = looked_at(np.array([20.0, 6.0]), times=5)
    for k in sightings.keyframe:
        values.insert(pose_key(0, int(k)), standing(int(k)))
    values.insert(track_key(0), np.array([20.0, 6.0]))
    values.insert(landmark_key(3), np.array([30.0, 6.0]))  # fifty sigmas away
    values.insert(range_offset_key(0), np.zeros(2))
    add_sightings(graph, sightings, np.full(5, 3), kernel=Kernel("dcs", 3.0))
    assert graph.error(values) < 2.0 * 3.0**2  # 1 250 without: the kernel's bound


@settings(max_examples=40, deadline=None)
@given(st.tuples(METRES, METRES, st.floats(-math.pi, math.pi)), METRES, METRES)
def test_a_seen_point_has_the_derivatives_it_says(pose: tuple[float, float, float], x_m: float, y_m: float) -> None:
    by_offset = np.array([[0.6, 0.1], [0.8, -0.3]])
    noise = gtsam.noiseModel.Isotropic.Sigma(2, 1.0)
    factor = point_factor((0, 1, 2), np.array([3.0, -4.0]), by_offset=by_offset, noise=noise)
    assert_derivatives(factor, values_of(gtsam.Pose2(*pose), np.array([0.02, 0.01]), np.array([x_m, y_m])), (3, 2, 2))
