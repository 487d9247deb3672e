"""The gain of a label is the Kalman update's, written out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from trigpoint.anchoring.gain import label_terms, variance_reductions_m2

Floats = NDArray[np.float64]


def joint(landmarks: int, images: int, *, seed: int) -> Floats:
    """Any covariance of landmarks and image offsets."""
    root = np.random.default_rng(seed).normal(size=(2 * (landmarks + images), 2 * (landmarks + images)))
    covariance: Floats = root @ root.T
    return covariance


def updated_reduction_m2(covariance: Floats, design: Floats, *, count: int, sigma_m: float) -> float:
    """The landmarks' summed variance before a measurement less that after it."""
    innovation = design @ covariance @ design.T + sigma_m**2 * np.eye(2)
    after = covariance - covariance @ design.T @ np.linalg.solve(innovation, design @ covariance)
    return float(np.trace(covariance[:count, :count]) - np.trace(after[:count, :count]))


@given(seed=st.integers(0, 2**32 - 1), landmark=st.integers(0, 3), image=st.sampled_from([None, 0, 1]))
def test_the_gain_is_the_kalman_updates(seed: int, landmark: int, image: int | None) -> None:
    covariance = joint(4, 2, seed=seed)
    design = np.zeros((2, 12))
    design[:, 2 * landmark : 2 * landmark + 2] = np.eye(2)
    if image is not None:
        design[:, 8 + 2 * image : 10 + 2 * image] = np.eye(2)
    terms = label_terms(covariance, landmark_count=4, image=image)
    reduced = variance_reductions_m2(*terms, sigma_m=0.3)[landmark]
    expected = updated_reduction_m2(covariance, design, count=8, sigma_m=0.3)
    assert reduced == pytest.approx(expected, rel=1e-6)  # rounding of nearly singular covariances


def test_a_label_that_knows_nothing_tells_nothing() -> None:
    terms = label_terms(joint(4, 0, seed=1), landmark_count=4, image=None)
    assert variance_reductions_m2(*terms, sigma_m=1e6).max() < 1e-9  # m^2


def test_a_perfect_survey_of_the_only_landmark_leaves_no_variance() -> None:
    covariance = joint(1, 0, seed=2)
    terms = label_terms(covariance, landmark_count=1, image=None)
    assert variance_reductions_m2(*terms, sigma_m=0.0)[0] == pytest.approx(np.trace(covariance))
