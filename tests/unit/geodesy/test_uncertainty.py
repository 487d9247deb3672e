"""Covariances and their ellipses."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from trigpoint.geodesy.uncertainty import Floats, ellipses_of, floored_covariance

MATRICES = arrays(np.float64, (3, 3), elements=st.floats(-1e3, 1e3))


@given(MATRICES)
def test_any_matrix_becomes_a_covariance(matrix: Floats) -> None:
    covariance = floored_covariance(matrix, floor=1e-3)
    assert np.array_equal(covariance, covariance.T)
    assert np.linalg.eigvalsh(covariance)[0] > 0.9e-3  # floor less the rounding of a rebuild with norms up to 3e3


def test_a_covariance_stays_itself() -> None:
    covariance = np.diag([4.0, 1.0])
    assert np.array_equal(floored_covariance(covariance, floor=1e-6), covariance)


def test_an_ellipse_points_along_its_longer_axis() -> None:
    turned = np.array([[math.cos(0.3), -math.sin(0.3)], [math.sin(0.3), math.cos(0.3)]])
    ((semi_major_m, semi_minor_m, heading_rad),) = ellipses_of((turned @ np.diag([9.0, 1.0]) @ turned.T)[np.newaxis])
    assert (semi_major_m, semi_minor_m) == pytest.approx((3.0, 1.0))
    assert math.tan(heading_rad) == pytest.approx(math.tan(0.3))
