"""The path between keyframes, and what was detected hung on them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from solved_worlds.examples import FRAME, SENSOR_M, Lap, World, world
from trigpoint.geodesy.poses import transform_points
from trigpoint_optimisation.core.detection_noise import DetectionNoise
from trigpoint_optimisation.core.preparation import PreparedDrive, nominal_calibration, prepared_drive
from trigpoint_optimisation.core.sightings import Averaging, drive_sightings, joined, keyframe_points
from trigpoint_optimisation.core.trajectory import output_stamps, poses_at
from trigpoint_optimisation.settings import SolveSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LAP = Lap(duration_s=30.0, speed_scale=1.0, yaw_bias_radps=0.0)
NOISE = DetectionNoise(range_sigma_m=0.1, bearing_sigma_rad=0.005, common_sigma_m=0.05)


@pytest.fixture(scope="module")
def block() -> World:
    return world(LAP)


@pytest.fixture(scope="module")
def prepared(block: World) -> PreparedDrive:
    settings, drive = SolveSettings(), block.drives[0]
    calibration = nominal_calibration(drive, settings.calibration, point_scale=FRAME.point_scale)
    return prepared_drive(drive, FRAME, settings, index=0, calibration=calibration)


def truth_at(block: World, prepared: PreparedDrive, stamp_ns: Ints) -> Floats:
    at_s, known_s = [
        (ns - prepared.drive.wheels.stamp_ns[0]) * 1e-9 for ns in (stamp_ns, prepared.drive.wheels.stamp_ns)
    ]
    return np.column_stack([np.interp(at_s, known_s, column) for column in block.poses[0].T])


def test_a_keyframe_is_where_it_is(block: World, prepared: PreparedDrive) -> None:
    pose = truth_at(block, prepared, prepared.stamp_ns)
    found = poses_at(prepared, pose, prepared.stamp_ns)
    np.testing.assert_allclose(found[:, :2], pose[:, :2], atol=1e-9)  # m, rounding
    np.testing.assert_allclose(np.cos(found[:, 2] - pose[:, 2]), 1.0, atol=1e-12)  # rounding


def test_between_true_keyframes_the_path_is_true(block: World, prepared: PreparedDrive) -> None:
    stamp_ns = prepared.drive.wheels.stamp_ns
    found = poses_at(prepared, truth_at(block, prepared, prepared.stamp_ns), stamp_ns)
    assert np.hypot(*(found - truth_at(block, prepared, stamp_ns))[:, :2].T).max() < 0.03  # m: wheel noise over 2 m


def test_a_keyframe_moved_by_a_solve_leaves_no_jump_in_the_path(block: World, prepared: PreparedDrive) -> None:
    pose = truth_at(block, prepared, prepared.stamp_ns)
    pose[20:, 0] += 1.0
    path = poses_at(prepared, pose, prepared.drive.wheels.stamp_ns)
    assert np.hypot(*np.diff(path[:, :2], axis=0).T).max() < 0.6  # m: 0.3 m a step and the metre spread over seven


@pytest.mark.parametrize("heading_rad", [0.0, 2.0, math.pi])
def test_turning_all_keyframes_turns_the_path_between_them(
    block: World, prepared: PreparedDrive, heading_rad: float
) -> None:
    T, stamp_ns = np.array([30.0, -5.0, heading_rad]), prepared.drive.wheels.stamp_ns
    pose = truth_at(block, prepared, prepared.stamp_ns)
    turned = np.column_stack([transform_points(T, pose[:, :2]), pose[:, 2] + heading_rad])
    expected = transform_points(T, poses_at(prepared, pose, stamp_ns)[:, :2])
    np.testing.assert_allclose(poses_at(prepared, turned, stamp_ns)[:, :2], expected, atol=1e-9)  # m, rounding


def test_the_path_is_given_at_keyframes_and_at_every_step(prepared: PreparedDrive) -> None:
    stamps = output_stamps(prepared, step_s=0.5)
    assert np.isin(prepared.stamp_ns, stamps).all()
    assert np.diff(stamps).min() > 0
    assert np.diff(stamps).max() <= 500_000_000


def test_a_detection_between_keyframes_is_placed_by_where_the_base_was_then(
    block: World, prepared: PreparedDrive
) -> None:
    pose = truth_at(block, prepared, prepared.stamp_ns)[prepared.detection_keyframe]
    point = transform_points(pose, keyframe_points(prepared, point_scale=FRAME.point_scale))
    off_m = np.hypot(*(point[:, None] - block.pole_m[None]).transpose(2, 0, 1)).min(axis=1)
    assert np.median(off_m) < 0.15  # m: range 0.1 m, bearing 0.005 rad at 20 m
    assert off_m.max() < 0.6  # m: over four sigma of both


def test_detections_of_one_track_from_one_keyframe_become_their_mean(prepared: PreparedDrive) -> None:
    rows = np.nonzero(prepared.detection_keyframe == prepared.detection_keyframe[0])[0]
    track = np.full(len(prepared.detection_keyframe), -1, dtype=np.int64)
    track[rows] = 0
    (point,) = drive_sightings(prepared, track, Averaging(point_scale=1.0, noise=NOISE)).point_m
    np.testing.assert_allclose(point, keyframe_points(prepared, point_scale=1.0)[rows].mean(axis=0))


def test_many_detections_are_no_surer_than_what_they_share(prepared: PreparedDrive) -> None:
    track = np.zeros(len(prepared.detection_keyframe), dtype=np.int64)
    covariance = drive_sightings(prepared, track, Averaging(point_scale=1.0, noise=NOISE)).covariance
    assert np.linalg.eigvalsh(covariance).min() >= NOISE.common_sigma_m**2


def test_independent_detections_average_their_noise(prepared: PreparedDrive) -> None:
    noise = replace(NOISE, bearing_sigma_rad=1e-9, common_sigma_m=0.0)
    rows = np.nonzero(prepared.detection_keyframe == prepared.detection_keyframe[0])[0]
    track = np.full(len(prepared.detection_keyframe), -1, dtype=np.int64)
    track[rows] = 0
    (covariance,) = drive_sightings(prepared, track, Averaging(point_scale=1.0, noise=noise)).covariance
    assert np.trace(covariance) == pytest.approx(0.1**2 / len(rows))  # each 0.1 m along its own ray


def test_a_sightings_covariance_lies_along_its_ray(prepared: PreparedDrive) -> None:
    # One detection: 0.1 m along the ray; across it 0.005 rad times the range.
    track = np.full(len(prepared.detection_keyframe), -1, dtype=np.int64)
    track[0] = 0
    noise = replace(NOISE, common_sigma_m=0.0)
    sighting = drive_sightings(prepared, track, Averaging(point_scale=1.0, noise=noise))
    sensor = transform_points(prepared.detection_offset[:1], SENSOR_M[None, :])
    ray = (sighting.point_m - sensor)[0]
    along = ray / np.hypot(*ray)
    across = np.array([-along[1], along[0]])
    assert along @ sighting.covariance[0] @ along == pytest.approx(0.1**2)
    assert across @ sighting.covariance[0] @ across == pytest.approx((0.005 * np.hypot(*ray)) ** 2)


def test_an_untracked_detection_is_no_sighting(prepared: PreparedDrive) -> None:
    none = np.full(len(prepared.detection_keyframe), -1, dtype=np.int64)
    assert len(drive_sightings(prepared, none, Averaging(point_scale=1.0, noise=NOISE)).track) == 0


def test_sightings_of_several_drives_are_put_together_in_order(prepared: PreparedDrive) -> None:
    track = np.zeros(len(prepared.detection_keyframe), dtype=np.int64)
    one = drive_sightings(prepared, track, Averaging(point_scale=1.0, noise=NOISE))
    both = joined([one, replace(one, drive=one.drive + 1)])
    assert both.drive.tolist() == [0] * len(one.drive) + [1] * len(one.drive)
    assert both.point_m.tolist() == [*one.point_m.tolist(), *one.point_m.tolist()]
