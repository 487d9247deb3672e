import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from trigpoint.events.mapped import TrajectorySolved
from trigpoint_evaluation.core.paths import antenna_points_m, poses_at

QUARTER_CIRCLE = np.array([[10.0, 0.0, math.pi / 2.0], [0.0, 10.0, math.pi]])  # radius 10 m about the origin
SECOND_NS = 1_000_000_000


def test_between_two_keyframes_the_path_is_the_arc_that_joins_them() -> None:
    (middle,) = poses_at(np.array([0, 2 * SECOND_NS]), QUARTER_CIRCLE, at_ns=np.array([SECOND_NS]))
    np.testing.assert_allclose(middle[:2], [10.0 / math.sqrt(2.0)] * 2, atol=1e-12)  # rounding, metres
    np.testing.assert_allclose(middle[2], 3.0 * math.pi / 4.0, atol=1e-12)  # rounding, radians


@given(share=st.floats(0.0, 1.0), turn_rad=st.floats(-3.0, 3.0))
def test_an_arc_keeps_its_ends_and_its_radius(share: float, turn_rad: float) -> None:
    ends = np.array([[5.0, 0.0, math.pi / 2.0], [5.0 * math.cos(turn_rad), 5.0 * math.sin(turn_rad), 0.0]])
    ends[1, 2] = math.pi / 2.0 + turn_rad
    (found,) = poses_at(np.array([0, SECOND_NS]), ends, at_ns=np.array([round(share * SECOND_NS)]))
    np.testing.assert_allclose(np.hypot(*found[:2]), 5.0, atol=1e-6)  # a nanosecond at 15 m/s is 1e-8 m


def test_heading_goes_the_short_way_over_the_seam() -> None:
    pose = np.array([[0.0, 0.0, math.pi - 0.1], [1.0, 0.0, -math.pi + 0.1]])
    (found,) = poses_at(np.array([0, SECOND_NS]), pose, at_ns=np.array([SECOND_NS // 2]))
    np.testing.assert_allclose(abs(found[2]), math.pi, atol=1e-9)  # rounding, radians


def test_outside_the_path_s_time_and_in_long_gaps_there_is_no_pose() -> None:
    stamps, at = np.array([0, 10 * SECOND_NS]), np.array([-1, 5 * SECOND_NS, 10 * SECOND_NS, 11 * SECOND_NS])
    known = np.isfinite(poses_at(stamps, QUARTER_CIRCLE, at_ns=at, gap_limit_s=5.0)[:, 0])
    assert known.tolist() == [False, False, True, False]


def test_a_path_of_one_pose_is_known_at_its_own_instant() -> None:
    found = poses_at(np.array([7]), QUARTER_CIRCLE[:1], at_ns=np.array([7, 8]))
    np.testing.assert_allclose(found[0], QUARTER_CIRCLE[0])
    assert np.isnan(found[1]).all()


def test_the_antenna_stands_where_its_calibrated_lever_arm_says() -> None:
    solved = TrajectorySolved(
        map_version=1,
        vehicle="car",
        boot_id="b",
        stamp_ns=np.array([0, SECOND_NS]),
        pose=np.array([[0.0, 0.0, math.pi / 2.0], [0.0, 8.0, math.pi / 2.0]]),
        covariance=np.zeros((2, 3, 3)),
        calibration=(("antenna_x_m", 3.0, 0.1), ("antenna_y_m", 0.5, 0.1)),
    )
    found = antenna_points_m(solved, np.array([SECOND_NS // 2]))
    np.testing.assert_allclose(found, [[-0.5, 7.0]], atol=1e-9)  # rounding, metres: 4 m on, then ahead and left
