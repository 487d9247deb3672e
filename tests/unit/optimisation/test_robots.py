"""Robots without positioning, with cameras and surveyed posts: one map, their calibrations found."""

import numpy as np
import pytest

from solved_worlds.examples import FRAME, START_NS
from solved_worlds.robots import POSTS_M, SPEED_SCALE, STEP_S, TURN_SCALE, Hall, hall, without_landmarks
from trigpoint_optimisation.core.odometry import TurnSource
from trigpoint_optimisation.core.solve import Solution
from trigpoint_optimisation.core.stages import Solved, landmark_signatures, solve_fleet
from trigpoint_optimisation.core.trajectory import poses_at
from trigpoint_optimisation.settings import SolveSettings

SETTINGS = SolveSettings(method="anchored")


@pytest.fixture(scope="module")
def among_posts() -> Hall:
    return hall(2)


@pytest.fixture(scope="module")
def tied_to_three(among_posts: Hall) -> Solved:
    return solve_fleet(among_posts.drives, among_posts.anchors[:3], FRAME, SETTINGS)


def path_error_m(found: Solved, index: int, among_posts: Hall) -> float:
    pose = among_posts.poses[index]
    stamp_ns = START_NS + np.round(np.arange(0, len(pose) - 10, 5) * STEP_S * 1e9).astype(np.int64)
    solved_pose = poses_at(found.fleet.prepared[index], found.state.drives[index].pose, stamp_ns)
    return float(np.hypot(*(solved_pose[:, :2] - pose[:-10:5, :2]).T).mean())


def test_three_surveyed_posts_place_all_others(tied_to_three: Solved) -> None:
    names = landmark_signatures(tied_to_three)
    true = np.array([POSTS_M[int(name.removeprefix("post-"))] for name in names])
    assert len(names) == len(POSTS_M)
    assert np.hypot(*(tied_to_three.state.landmark_m - true).T).max() < 0.05  # m: bearing noise is 0.04 m at 6 m


def test_the_robots_are_where_they_drove(tied_to_three: Solved, among_posts: Hall) -> None:
    errors_m = [path_error_m(tied_to_three, index, among_posts) for index in (0, 1)]
    assert max(errors_m) < 0.05  # m


def test_what_becomes_of_a_command_is_found(tied_to_three: Solved) -> None:
    assert {each.source for each in tied_to_three.fleet.prepared} == {TurnSource.COMMAND}
    scale = np.array([drive.scale for drive in tied_to_three.state.drives])
    np.testing.assert_allclose(scale[:, 0], SPEED_SCALE, atol=0.03)  # a minute's drive against a prior of 0.05
    np.testing.assert_allclose(scale[:, 1], TURN_SCALE, atol=0.02)
    np.testing.assert_allclose(scale[:, 2], -0.15, atol=0.05)  # s: a command acts half a step after it is stamped


def test_the_cameras_depth_is_told_from_range(tied_to_three: Solved) -> None:
    off_axis = [drive.sensor[2] for drive in tied_to_three.state.drives]
    np.testing.assert_allclose(off_axis, -0.5, atol=0.03)  # per rad^2; the prior is 0 with 0.5


def test_robots_that_see_each_other_hold_each_other(tied_to_three: Solved) -> None:
    seen = tied_to_three.singles.seen_drive
    assert (seen[tied_to_three.singles.landmark < 0] >= 0).all()
    assert {0, 1} <= set(seen.tolist())


def test_a_robot_that_sees_only_the_other_robot_is_left_out(among_posts: Hall) -> None:
    drives = among_posts.drives[0], without_landmarks(among_posts.drives[1])
    found = solve_fleet(drives, among_posts.anchors, FRAME, SETTINGS)
    assert [one.vehicle for one in found.left_out] == ["robot2"]
    assert not (found.singles.landmark < 0).any()


def test_a_map_without_fixes_has_just_its_place_undetermined(tied_to_three: Solved) -> None:
    # Without labels nothing says where the map lies, nor how it is turned: three directions, and no fourth.
    eigenvalues = np.linalg.eigvalsh(Solution(solved=tied_to_three).reduction().information)
    assert np.abs(eigenvalues[:3]).max() < 1e-6 * eigenvalues[-1]
    assert eigenvalues[3] > 1e-6 * eigenvalues[-1]


def test_the_solved_map_names_posts_and_anchors(tied_to_three: Solved) -> None:
    solved_map = Solution(solved=tied_to_three).map
    assert {landmark.landmark for landmark in solved_map.landmarks} == {f"post-{row}" for row in range(len(POSTS_M))}
    assert [anchor.landmark for anchor in solved_map.anchors] == ["post-0", "post-1", "post-2"]
