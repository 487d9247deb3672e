"""Drives in frames of their own come together by the landmarks they share."""

import numpy as np
import pytest
from numpy.typing import NDArray

from trigpoint.geodesy.poses import transform_points
from trigpoint_optimisation.core.joining import LocalDrive, joined_drives, mean_points, moved, rigid_onto

Floats = NDArray[np.float64]

PLACES = {"a": np.array([0.0, 0.0]), "b": np.array([5.0, 1.0]), "c": np.array([2.0, 6.0]), "d": np.array([7.0, 7.0])}
MOTION = np.array([10.0, -4.0, 2.5])


def turned(names: str, motion: Floats = MOTION) -> LocalDrive:
    """A drive that knows these places in a frame that `motion` takes into the map."""
    c, s = np.cos(motion[2]), np.sin(motion[2])
    back = np.array([[c, s], [-s, c]])
    return LocalDrive(
        pose=np.array([[0.0, 0.0, 0.0]]), point_m={name: back @ (PLACES[name] - motion[:2]) for name in names}
    )


def test_two_common_landmarks_fix_a_frame() -> None:
    assert rigid_onto(turned("ab").point_m, PLACES) == pytest.approx(MOTION)


def test_one_common_landmark_does_not() -> None:
    assert rigid_onto(turned("a").point_m, PLACES) is None


def test_a_landmark_taken_for_another_is_outvoted() -> None:
    point = turned("abcd").point_m
    wrong = {**point, "d": point["d"] + (4.0, -3.0)}
    found = rigid_onto(wrong, PLACES)
    assert found is not None
    assert np.hypot(*(transform_points(found, point["a"]) - PLACES["a"])) < 0.2  # m; plain least squares: 1.2


def test_drives_are_chained_by_what_they_share_in_pairs() -> None:
    groups = joined_drives({0: turned("abc"), 1: turned("bcd", np.array([1.0, 2.0, -1.0])), 2: turned("cd")})
    assert [sorted(group) for group in groups] == [[0, 1, 2]]
    known = mean_points([each.point_m for each in groups[0].values()])
    assert rigid_onto(known, PLACES) == pytest.approx(MOTION)


def test_drives_that_share_too_little_stay_apart() -> None:
    groups = joined_drives({0: turned("ab"), 1: turned("bd")})
    assert [sorted(group) for group in groups] == [[0], [1]]


def test_poses_move_with_the_frame() -> None:
    after = moved(turned("ab"), MOTION)
    assert after.pose[0] == pytest.approx(MOTION)
    assert after.point_m["b"] == pytest.approx(PLACES["b"])
