"""Dead reckoning, keyframes, and motions with their derivatives by the calibration."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from driven_paths.examples import FRAME, Course, Driven, driven
from trigpoint.geodesy.poses import Pose2, transform_points
from trigpoint_optimisation.core.odometry import (
    OdometryCalibration,
    OdometryNoise,
    TurnSource,
    dead_reckon,
    keyframe_motions,
    keyframe_stamps,
    relative_poses,
    turn_source,
)

Floats = NDArray[np.float64]

MAX_GAP_S = 2.0
POSES = st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(-math.pi, math.pi))
NOISE = OdometryNoise(
    along_m=0.03,
    across_m=0.01,
    heading_rad=0.004,
    heading_rad_per_sqrt_s=0.0003,
    turn_fraction=0.02,
    floor_m=0.005,
    floor_rad=0.0005,
)


def calibration(course: Course = Course()) -> OdometryCalibration:  # noqa: B008
    """The calibration that is right for a course."""
    bias = course.yaw_bias_radps if course.turns_by == "imu" else 0.0
    return OdometryCalibration(
        speed_scale=course.speed_scale * FRAME.point_scale,
        turn_scale=course.steering_scale,
        delay_s=0.0,
        bias_stamp_ns=driven(course).drive.wheels.stamp_ns[:1],
        turn_bias=np.array([bias]),
    )


def straying_m(world: Driven, own: OdometryCalibration) -> float:
    """The largest distance in m between dead reckoning, started right, and the truth."""
    path = dead_reckon(world.drive, own, max_gap_s=MAX_GAP_S)
    return float(np.hypot(*(transform_points(world.pose[0], path.pose[:, :2]) - world.pose[:, :2]).T).max())


@pytest.mark.parametrize("turns_by", ["imu", "steering", "wheels"])
def test_dead_reckoning_at_the_right_calibration_is_the_truth(turns_by: str) -> None:
    course = Course(turns_by=turns_by, speed_scale=1.04, yaw_bias_radps=0.003)
    assert straying_m(driven(course), calibration(course)) < 1.0  # m of 1200: means of ends, the truth takes ends


def test_a_wrong_speed_scale_shows_at_its_size() -> None:
    course = Course(turn_radps=0.0)
    wrong = replace(calibration(course), speed_scale=1.06 * FRAME.point_scale)
    assert straying_m(driven(course), wrong) == pytest.approx(0.06 * 1200.0, rel=0.01)  # last 0.1 s is not driven


def test_steering_scaled_wrong_leaves_the_road() -> None:
    course = Course(turns_by="steering", steering_scale=1.06)
    wrong = replace(calibration(course), turn_scale=1.0)
    assert straying_m(driven(course), wrong) > 20.0 * straying_m(driven(course), calibration(course))


@pytest.mark.parametrize("turns_by", ["imu", "steering"])
def test_a_speed_wheel_beside_the_middle_goes_slower_inside(turns_by: str) -> None:
    # Wheel 1 m to the left of the base, turning left at 0.1 rad/s: the base goes faster by 0.1 m/s than the wheel.
    world = driven(Course(turn_radps=0.1, turns_by=turns_by))
    beside = replace(world.drive, described=replace(world.drive.described, speed_wheel_y_m=1.0))
    own = calibration()
    middle_m = dead_reckon(world.drive, own, max_gap_s=MAX_GAP_S).distance_m
    path = dead_reckon(beside, own, max_gap_s=MAX_GAP_S)
    beside_m, turned = path.distance_m, path.pose[:, 2]
    np.testing.assert_allclose(beside_m - middle_m, turned - turned[0], atol=1e-6)  # m: 1 m times rad, rounding


def test_a_late_wheel_clock_is_put_right() -> None:
    own = replace(calibration(), delay_s=0.25)
    path = dead_reckon(driven(Course()).drive, own, max_gap_s=MAX_GAP_S)
    assert driven(Course()).drive.wheels.stamp_ns[0] - path.stamp_ns[0] == 250_000_000


def test_a_gap_in_the_wheels_is_driven_on_for_no_longer_than_its_limit() -> None:
    world = driven(Course(turn_radps=0.0))
    keep = np.ones(len(world.drive.wheels.stamp_ns), dtype=bool)
    keep[500:1000] = False  # 50 s
    wheels = world.drive.wheels
    holed = replace(
        wheels,
        stamp_ns=wheels.stamp_ns[keep],
        speed_mps=wheels.speed_mps[keep],
        steering_rad=wheels.steering_rad[keep],
        yaw_rate_radps=wheels.yaw_rate_radps[keep],
    )
    path = dead_reckon(replace(world.drive, wheels=holed), calibration(), max_gap_s=MAX_GAP_S)
    assert path.distance_m[500] - path.distance_m[499] == pytest.approx(2.0 * 6.0, rel=0.001)  # point scale


@pytest.mark.parametrize(
    ("turns_by", "source"),
    [("imu", TurnSource.IMU), ("steering", TurnSource.STEERING), ("nothing", TurnSource.NONE)],
)
def test_the_best_turn_source_is_taken(turns_by: str, source: TurnSource) -> None:
    assert turn_source(driven(Course(turns_by=turns_by)).drive) is source


def test_a_path_is_interpolated_and_held_at_its_ends() -> None:
    path = dead_reckon(driven(Course(turn_radps=0.0)).drive, calibration(), max_gap_s=MAX_GAP_S)
    before, between, after = path.at(np.array([0, path.stamp_ns[0] + 50_000_000, 2 * path.stamp_ns[-1]]))
    assert tuple(before) == tuple(path.pose[0])
    assert tuple(between) == pytest.approx((0.3, 0.0, 0.0), rel=0.001)  # half a step of 0.6 m, point scale
    assert tuple(after) == tuple(path.pose[-1])


def test_keyframes_are_no_further_apart_than_asked() -> None:
    path = dead_reckon(driven(Course()).drive, calibration(), max_gap_s=MAX_GAP_S)
    stamp_ns = keyframe_stamps(path, distance_m=2.0, turn_rad=0.2, moving_s=1.0)
    assert np.hypot(*np.diff(path.at(stamp_ns)[:, :2], axis=0).T).max() <= 2.0 + 0.61  # m, and one wheel step
    assert (stamp_ns[0], stamp_ns[-1]) == (path.stamp_ns[0], path.stamp_ns[-1])


def test_a_standing_vehicle_gets_no_keyframes_but_its_ends() -> None:
    path = dead_reckon(driven(Course(speed_mps=0.0)).drive, calibration(), max_gap_s=MAX_GAP_S)
    assert len(keyframe_stamps(path, distance_m=2.0, turn_rad=0.2, moving_s=1.0)) == 2


def test_a_crawling_vehicle_gets_keyframes_by_time() -> None:
    course = Course(speed_mps=0.05, turn_radps=0.0)
    path = dead_reckon(driven(course).drive, calibration(course), max_gap_s=MAX_GAP_S)
    assert len(keyframe_stamps(path, distance_m=2.0, turn_rad=0.2, moving_s=1.0)) == pytest.approx(200, abs=2)


@settings(deadline=None)
@given(POSES, POSES)
def test_a_relative_pose_takes_the_one_into_the_other(
    a: tuple[float, float, float], b: tuple[float, float, float]
) -> None:
    relative = relative_poses(np.array([a]), np.array([b]))[0]
    back = Pose2(*a).compose(Pose2(*relative))
    assert (back.x_m, back.y_m) == pytest.approx(b[:2], abs=1e-7)  # m, rounding at 10 km
    assert math.cos(back.heading_rad - b[2]) == pytest.approx(1.0, abs=1e-12)  # rounding


@settings(deadline=None)
@given(POSES, POSES, POSES)
def test_relative_poses_do_not_know_the_frame(
    T: tuple[float, float, float], a: tuple[float, float, float], b: tuple[float, float, float]
) -> None:
    moved = [np.array([[*transform_points(np.array(T), np.array(p[:2])), T[2] + p[2]]]) for p in (a, b)]
    here, there = relative_poses(np.array([a]), np.array([b])), relative_poses(*moved)
    np.testing.assert_allclose(here[0, :2], there[0, :2], atol=1e-7)  # m, rounding at 10 km
    assert math.cos(here[0, 2] - there[0, 2]) == pytest.approx(1.0, abs=1e-12)  # rounding


@pytest.mark.parametrize("turns_by", ["imu", "steering", "wheels"])
def test_motions_follow_their_derivatives_to_another_calibration(turns_by: str) -> None:
    drive, own = driven(Course(turns_by=turns_by, duration_s=60.0)).drive, calibration()
    stamp_ns = drive.wheels.stamp_ns[::4]
    change = np.array([0.01, 0.02, 0.02, 0.001])
    other = replace(
        own,
        speed_scale=own.speed_scale + change[0],
        turn_scale=own.turn_scale + change[1],
        delay_s=own.delay_s + change[2],
        turn_bias=own.turn_bias + change[3],
    )
    here = keyframe_motions(drive, own, stamp_ns, noise=NOISE, max_gap_s=MAX_GAP_S)
    there = keyframe_motions(drive, other, stamp_ns, noise=NOISE, max_gap_s=MAX_GAP_S)
    # m and rad: second order of a two-metre step, 1 % of what the change itself moves
    np.testing.assert_allclose((here.delta + here.derivative @ change)[1:-1], there.delta[1:-1], atol=5e-4)


def test_a_motion_is_as_uncertain_as_its_length_says() -> None:
    course = Course(turn_radps=0.0)
    drive = driven(course).drive
    short = keyframe_motions(drive, calibration(), drive.wheels.stamp_ns[::10], noise=NOISE, max_gap_s=MAX_GAP_S)
    long = keyframe_motions(drive, calibration(), drive.wheels.stamp_ns[::40], noise=NOISE, max_gap_s=MAX_GAP_S)
    floor_m2 = NOISE.floor_m**2
    assert long.covariance[3, 0, 0] - floor_m2 == pytest.approx(4.0 * (short.covariance[3, 0, 0] - floor_m2))


@pytest.mark.parametrize("course", [Course(), Course(turns_by="steering"), Course(speed_mps=0.0)])
def test_every_motion_has_a_positive_definite_covariance(course: Course) -> None:
    drive = driven(course).drive
    motions = keyframe_motions(drive, calibration(), drive.wheels.stamp_ns[::7], noise=NOISE, max_gap_s=MAX_GAP_S)
    assert np.linalg.eigvalsh(motions.covariance).min() > 0.0


def test_a_turn_bias_acts_from_its_own_knot_on() -> None:
    drive = driven(Course(duration_s=100.0)).drive
    start_ns = int(drive.wheels.stamp_ns[0])
    knots = replace(
        calibration(),
        bias_stamp_ns=np.array([start_ns, start_ns + 60_000_000_000]),
        turn_bias=np.array([0.0, 0.01]),
    )
    path = dead_reckon(drive, knots, max_gap_s=MAX_GAP_S)
    plain = dead_reckon(drive, calibration(), max_gap_s=MAX_GAP_S)
    extra = path.pose[:, 2] - plain.pose[:, 2]
    assert extra[600] == pytest.approx(0.0, abs=1e-12)  # rad, rounding
    assert extra[900] == pytest.approx(0.01 * 30.0, abs=1e-9)  # rad, rounding
