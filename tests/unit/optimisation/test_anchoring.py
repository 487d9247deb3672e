"""Labels find their landmarks, or stay unassigned and say why."""

import numpy as np
import pytest
from numpy.typing import NDArray

from anchored_maps.examples import LABEL_SIGMA_M, labels_at
from trigpoint.anchoring.association import UNASSIGNED, Assignment
from trigpoint_optimisation.core.anchoring import (
    residuals_m,
    tied_labels,
    voted_assignment,
    without_outliers,
)
from trigpoint_optimisation.settings import AnchorSettings, DetectionSettings

Floats = NDArray[np.float64]

ANCHORS, DETECTIONS = AnchorSettings(), DetectionSettings()


def campus(count: int = 120, *, seed: int = 1) -> Floats:
    """Poles (n, 2) over 300 x 300 m, some in pairs 1.5 m apart."""
    rng = np.random.default_rng(seed)
    poles = rng.uniform(0.0, 300.0, (count, 2))
    poles[-10:] = poles[:10] + (1.5, 0.0)
    return poles


@pytest.mark.parametrize("off_m", [0.0, 2.5, 4.0, 6.0, 8.0])
def test_a_map_that_is_off_as_a_whole_is_never_assigned_wrongly(off_m: float) -> None:
    poles = campus()
    labels = labels_at(poles[::2] + np.random.default_rng(3).normal(0.0, LABEL_SIGMA_M, poles[::2].shape))
    found = voted_assignment(labels, poles + off_m * np.array([0.6, -0.8]), settings=ANCHORS, detections=DETECTIONS)
    tied = found.landmark >= 0
    assert (found.landmark[tied] == 2 * np.nonzero(tied)[0]).all()
    assert tied.mean() > 0.9


def test_an_evenly_spaced_row_of_labels_stays_unassigned_rather_than_shifted_by_one() -> None:
    row = np.column_stack([np.arange(20) * 5.0, np.zeros(20)])
    found = voted_assignment(labels_at(row), row + (2.5, 0.0), settings=ANCHORS, detections=DETECTIONS)
    assert (found.landmark == UNASSIGNED).all()
    assert set(found.reason) == {"no joint shift stands out"}


def test_no_landmark_is_voted_to_two_labels() -> None:
    poles = campus()
    labels = labels_at(np.concatenate([poles, poles + (0.2, 0.0)]))
    landmark = voted_assignment(labels, poles, settings=ANCHORS, detections=DETECTIONS).landmark
    tied = landmark[landmark >= 0]
    assert len(np.unique(tied)) == len(tied) > 0


def test_only_assigned_labels_are_tied() -> None:
    labels = labels_at(np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]))
    tied = tied_labels(labels, Assignment(landmark=np.array([5, UNASSIGNED, 2]), reason=("", "", "")))
    assert tied.landmark.tolist() == [5, 2]
    assert tied.label_m.tolist() == [[0.0, 0.0], [2.0, 2.0]]


def test_a_residual_is_the_label_less_landmark_and_image_offset() -> None:
    labels = labels_at(np.array([[3.0, 1.0], [0.0, 0.0]]), image=0)
    assignment = Assignment(landmark=np.array([0, UNASSIGNED]), reason=("", ""))
    residual = residuals_m(labels, assignment, np.array([[2.0, 1.0]]), np.array([[0.4, 0.1]]))
    np.testing.assert_allclose(residual[0], (0.6, -0.1), atol=1e-12)  # m, rounding
    assert np.isnan(residual[1]).all()


def test_an_unbelievable_label_is_let_go_with_its_residual_and_the_limit() -> None:
    assignment = Assignment(landmark=np.array([0, 1]), reason=("mutually nearest", "mutually nearest"))
    residual = np.array([[0.1, 0.0], [0.3, 0.4]])
    kept = without_outliers(assignment, assignment, residual, np.full(2, 0.1), limit_sigmas=4.0)
    assert kept.landmark.tolist() == [0, UNASSIGNED]
    assert kept.reason == ("mutually nearest", "residual 5.0 sigma, limit 4.0")


def test_a_label_tied_only_now_is_not_judged_before_its_images_offset_is_solved_for() -> None:
    untied = Assignment(landmark=np.array([UNASSIGNED]), reason=("no joint shift stands out",))
    tied = Assignment(landmark=np.array([3]), reason=("mutually nearest",))
    kept = without_outliers(tied, untied, np.array([[0.7, 0.3]]), np.array([0.1]), limit_sigmas=4.0)
    assert kept.landmark.tolist() == [3]


def test_a_label_let_go_stays_out_with_its_reason() -> None:
    let_go = Assignment(landmark=np.array([UNASSIGNED]), reason=("residual 7.6 sigma, limit 4.0",))
    tied = Assignment(landmark=np.array([3]), reason=("mutually nearest",))
    kept = without_outliers(tied, let_go, np.array([[0.0, 0.0]]), np.array([0.1]), limit_sigmas=4.0)
    assert (kept.landmark.tolist(), kept.reason) == ([UNASSIGNED], let_go.reason)
