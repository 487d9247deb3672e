"""Rigid motions of the plane."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trigpoint.geodesy.poses import Pose2, transform_points, wrap_angle_rad, wrap_angles_rad

METRES = st.floats(-1e4, 1e4)
POSES = st.builds(Pose2, METRES, METRES, st.floats(-math.pi, math.pi, exclude_max=True))
NANOMETRE = 1e-7  # m: 1e4 m times the rounding of a few float64 operations, with a wide margin


def test_a_left_turn_takes_ahead_to_the_left() -> None:
    assert Pose2(10.0, 20.0, math.pi / 2).transform(3.0, 0.0) == pytest.approx((10.0, 23.0))


@given(POSES, POSES, METRES, METRES)
def test_composing_is_transforming_twice(T_a_b: Pose2, T_b_c: Pose2, x_m: float, y_m: float) -> None:
    assert T_a_b.compose(T_b_c).transform(x_m, y_m) == pytest.approx(
        T_a_b.transform(*T_b_c.transform(x_m, y_m)), abs=NANOMETRE
    )


@given(POSES, METRES, METRES)
def test_the_inverse_takes_a_point_back(T_a_b: Pose2, x_m: float, y_m: float) -> None:
    assert T_a_b.inverse().transform(*T_a_b.transform(x_m, y_m)) == pytest.approx((x_m, y_m), abs=NANOMETRE)


@given(st.floats(-100.0, 100.0))
def test_a_wrapped_angle_is_the_same_direction_in_range(angle_rad: float) -> None:
    wrapped_rad = wrap_angle_rad(angle_rad)
    assert -math.pi <= wrapped_rad < math.pi
    assert math.cos(wrapped_rad - angle_rad) == pytest.approx(1.0, abs=1e-12)  # cosine of a rounding error
    assert wrap_angles_rad(np.array([angle_rad]))[0] == wrapped_rad


@given(POSES, METRES, METRES)
def test_arrays_transform_as_single_poses_do(T_a_b: Pose2, x_m: float, y_m: float) -> None:
    row = np.array([[T_a_b.x_m, T_a_b.y_m, T_a_b.heading_rad]])
    point_a_m = transform_points(row, np.array([[x_m, y_m]]))
    assert tuple(point_a_m[0]) == pytest.approx(T_a_b.transform(x_m, y_m), abs=NANOMETRE)
