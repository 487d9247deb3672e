"""Relative poses between two times: from the truth they cost nothing, wrong ones bend no path."""

from dataclasses import replace

import gtsam
import numpy as np
import pytest
from numpy.typing import NDArray

from driven_paths.examples import FRAME, Course, driven
from trigpoint.events.drives import NO_MOTIONS, MotionSeries
from trigpoint_optimisation.core.odometry import relative_poses
from trigpoint_optimisation.core.preparation import PreparedDrive, nominal_calibration, prepared_drive
from trigpoint_optimisation.core.relative_poses import (
    add_relative_poses,
    between_keyframes,
    hung_motions,
    scaled,
)
from trigpoint_optimisation.core.state import pose_key
from trigpoint_optimisation.settings import Kernel, OdometrySettings, SolveSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SCALE = FRAME.point_scale
SETTINGS = SolveSettings(odometry=OdometrySettings(keyframe_m=6.0))
WORLD = driven(Course(duration_s=60.0))
STEP_NS = 100_000_000
SIGMA = np.array([0.02, 0.03, 0.001])
SAME_M = 0.05  # dead reckoning from each end's keyframe, up to 6 m before it


@pytest.fixture(scope="module")
def prepared() -> PreparedDrive:
    calibration = nominal_calibration(WORLD.drive, SETTINGS.calibration, point_scale=SCALE)
    return prepared_drive(WORLD.drive, FRAME, SETTINGS, index=0, calibration=calibration)


def true_motions(from_stamp_ns: Ints, stamp_ns: Ints) -> MotionSeries:
    """What a perfect sensor tells of how the base moved."""
    motion = relative_poses(WORLD.pose_at(from_stamp_ns), WORLD.pose_at(stamp_ns)) / (SCALE, SCALE, 1.0)
    covariance = np.repeat(np.diag(SIGMA**2)[None], len(stamp_ns), axis=0)
    return MotionSeries(from_stamp_ns=from_stamp_ns, stamp_ns=stamp_ns, motion=motion, covariance=covariance)


def sweeps(prepared: PreparedDrive) -> MotionSeries:
    """Motions from sweep to sweep, ten a second, from before the first keyframe to after the last."""
    stamp_ns = np.arange(prepared.stamp_ns[0] - STEP_NS, prepared.stamp_ns[-1] + STEP_NS, STEP_NS)
    return true_motions(stamp_ns[:-1], stamp_ns[1:])


def at_truth(prepared: PreparedDrive) -> gtsam.Values:
    values = gtsam.Values()
    for k, pose in enumerate(WORLD.pose_at(prepared.stamp_ns)):
        values.insert(pose_key(0, k), gtsam.Pose2(*pose))
    return values


def test_the_pose_between_two_times_is_that_between_their_keyframes(prepared: PreparedDrive) -> None:
    begin_ns = prepared.stamp_ns[0]
    motions = true_motions(np.array([begin_ns + 7_050_000_000]), np.array([begin_ns + 31_330_000_000]))
    hung = hung_motions(prepared, prepared, motions, point_scale=SCALE)
    pose = WORLD.pose_at(prepared.stamp_ns)
    expected = relative_poses(pose[hung.from_keyframe], pose[hung.to_keyframe])
    assert np.abs(hung.T_from_to - expected).max() < SAME_M


def test_a_time_no_wheel_covers_is_left_out(prepared: PreparedDrive) -> None:
    first, last = prepared.stamp_ns[[0, -1]]
    motions = true_motions(np.array([first - 1, first, first]), np.array([last, last, last + 1]))
    assert len(hung_motions(prepared, prepared, motions, point_scale=SCALE).covariance) == 1


def test_a_factor_takes_the_error_as_the_motion_told_it(prepared: PreparedDrive) -> None:
    # From a keyframe to another one: an error of one sigma in each of the three costs 3 / 2.
    motions = true_motions(prepared.stamp_ns[[3]], prepared.stamp_ns[[9]])
    off = replace(motions, motion=motions.motion + SIGMA)
    graph = gtsam.NonlinearFactorGraph()
    add_relative_poses(graph, hung_motions(prepared, prepared, off, point_scale=SCALE), kernel=None)
    assert graph.error(at_truth(prepared)) == pytest.approx(1.5, rel=0.01)  # a turn of 0.001 rad bends the step


def test_sweeps_become_one_motion_a_keyframe(prepared: PreparedDrive) -> None:
    between = between_keyframes(prepared, sweeps(prepared))
    assert np.abs(between.motion - true_motions(between.from_stamp_ns, between.stamp_ns).motion).max() < 1e-4
    assert prepared.hung(between.from_stamp_ns)[0].tolist() == list(range(len(between.stamp_ns)))


def test_errors_of_sweeps_add_up_along_the_chain(prepared: PreparedDrive) -> None:
    many = sweeps(prepared)
    between = between_keyframes(prepared, many)
    count = (between.stamp_ns - between.from_stamp_ns) / STEP_NS
    assert between.covariance[:, 2, 2] == pytest.approx(count * SIGMA[2] ** 2)
    assert (between.covariance[:, 0, 0] >= count * min(SIGMA[:2]) ** 2).all()


def test_where_the_chain_is_broken_nothing_is_told(prepared: PreparedDrive) -> None:
    whole, middle_ns = sweeps(prepared), (prepared.stamp_ns[5] + prepared.stamp_ns[6]) // 2
    broken = whole.chosen(np.abs(whole.stamp_ns - middle_ns) > STEP_NS // 2)
    lost = set(between_keyframes(prepared, whole).from_stamp_ns) - set(
        between_keyframes(prepared, broken).from_stamp_ns
    )
    assert prepared.hung(np.array(sorted(lost)))[0].tolist() == [5]


def test_a_drive_without_points_has_no_motion_between_keyframes(prepared: PreparedDrive) -> None:
    assert len(between_keyframes(prepared, NO_MOTIONS).stamp_ns) == 0


def test_a_wrong_match_pulls_less_under_a_kernel(prepared: PreparedDrive) -> None:
    motions = true_motions(prepared.stamp_ns[[3]], prepared.stamp_ns[[9]])
    wrong = replace(motions, motion=motions.motion + (5.0, 0.0, 0.0))
    hung = hung_motions(prepared, prepared, wrong, point_scale=SCALE)
    graph = gtsam.NonlinearFactorGraph()
    add_relative_poses(graph, hung, kernel=Kernel("dcs", 3.0))
    assert graph.error(at_truth(prepared)) < 2.0 * 3.0**2  # 31 250 without: the kernel's bound


def test_a_factor_multiplies_covariances(prepared: PreparedDrive) -> None:
    hung = hung_motions(prepared, prepared, sweeps(prepared), point_scale=SCALE)
    assert scaled(hung, 4.0).covariance == pytest.approx(4.0 * hung.covariance)
