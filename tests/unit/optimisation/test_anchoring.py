"""Labels find their landmarks, or stay unassigned and say why."""

import numpy as np
import pytest
from numpy.typing import NDArray

from driven_paths.examples import FRAME
from trigpoint.events.corrected import AnchorLabelled
from trigpoint.geodesy.projection import wgs84_from_map_points
from trigpoint_optimisation.core.anchoring import (
    NO_IMAGE,
    UNASSIGNED,
    Assignment,
    Labels,
    by_signature,
    labels_of,
    nearest_assignment,
    residuals_m,
    tied_labels,
    voted_assignment,
    without_outliers,
)
from trigpoint_optimisation.settings import AnchorSettings, DetectionSettings

Floats = NDArray[np.float64]

ANCHORS, DETECTIONS = AnchorSettings(), DetectionSettings()
LABEL_SIGMA_M = 0.1


def campus(count: int = 120, *, seed: int = 1) -> Floats:
    """Poles (n, 2) over 300 x 300 m, some in pairs 1.5 m apart."""
    rng = np.random.default_rng(seed)
    poles = rng.uniform(0.0, 300.0, (count, 2))
    poles[-10:] = poles[:10] + (1.5, 0.0)
    return poles


def labels_at(label_m: Floats, *, image: int = NO_IMAGE) -> Labels:
    count = len(label_m)
    return Labels(
        name=tuple(f"a{row}" for row in range(count)),
        labelled_in=("" if image == NO_IMAGE else "north",) * count,
        label_m=label_m,
        sigma_m=np.full(count, LABEL_SIGMA_M),
        image=np.full(count, image, dtype=np.int64),
        kind=("pole",) * count,
        signature=("",) * count,
        images=() if image == NO_IMAGE else ("north",),
        image_sigma_m=np.zeros(0) if image == NO_IMAGE else np.array([0.35]),
    )


def nearest(label_m: Floats, landmark_m: Floats, *, sigma_m: float = 0.3) -> Assignment:
    labels = labels_at(label_m)
    return nearest_assignment(
        labels, landmark_m, shift_m=np.zeros_like(label_m), sigma_m=np.full(len(label_m), sigma_m), settings=ANCHORS
    )


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


def test_a_label_is_tied_to_its_mutually_nearest_landmark() -> None:
    found = nearest(np.array([[0.2, 0.0], [50.1, 0.0]]), np.array([[50.0, 0.0], [0.0, 0.0]]))
    assert found.landmark.tolist() == [1, 0]


def test_a_label_between_two_poles_stays_unassigned_and_says_how_far_both_are() -> None:
    found = nearest(np.array([[0.7, 0.0]]), np.array([[0.0, 0.0], [1.5, 0.0]]))
    assert found.landmark.tolist() == [UNASSIGNED]
    assert found.reason == ("two landmarks 0.70 m and 0.80 m away",)  # a gate of 3.5 x 0.3 m holds both


def test_a_label_beyond_the_gate_says_the_distance_and_the_gate() -> None:
    found = nearest(np.array([[5.0, 0.0]]), np.array([[0.0, 0.0]]))
    assert found.reason == ("nearest landmark 5.00 m away, gate 1.05 m",)


def test_of_two_labels_at_one_landmark_the_nearer_has_it() -> None:
    found = nearest(np.array([[0.5, 0.0], [0.1, 0.0]]), np.array([[0.0, 0.0]]))
    assert found.landmark.tolist() == [UNASSIGNED, 0]
    assert found.reason[0] == "another label is nearer to the landmark"


def test_the_images_known_offset_is_taken_off_before_looking() -> None:
    labels = labels_at(np.array([[3.0, 0.0]]), image=0)
    found = nearest_assignment(
        labels, np.zeros((1, 2)), shift_m=np.array([[3.0, 0.0]]), sigma_m=np.array([0.1]), settings=ANCHORS
    )
    assert found.landmark.tolist() == [0]


def test_without_landmarks_every_label_is_unassigned() -> None:
    assert nearest(np.zeros((2, 2)), np.zeros((0, 2))).reason == ("no landmark", "no landmark")


def anchor(name: str, place_m: Floats, **changes: object) -> AnchorLabelled:
    lat_deg, lon_deg = wgs84_from_map_points(place_m[None, :], FRAME)
    plain: dict[str, object] = {"sigma_m": 0.1, "image": "north", "image_sigma_m": 0.35, "kind": "pole"}
    rest = plain | {"signature": "", "source_crs": "EPSG:4326", "operation": ""} | changes
    return AnchorLabelled(anchor=name, lat_deg=float(lat_deg[0]), lon_deg=float(lon_deg[0]), **rest)  # type: ignore[arg-type]


def test_labels_come_into_the_map_with_their_images() -> None:
    places = np.array([[100.0, 200.0], [300.0, 50.0]])
    labels = labels_of([anchor("a", places[0]), anchor("b", places[1], image="east")], FRAME, image_offsets=True)
    np.testing.assert_allclose(labels.label_m, places, atol=1e-6)  # m: degrees there and back
    assert (labels.images, labels.image.tolist()) == (("east", "north"), [1, 0])


def test_a_surveyed_point_has_no_image_to_be_off_by() -> None:
    labels = labels_of([anchor("a", np.zeros(2), image_sigma_m=0.0)], FRAME, image_offsets=True)
    assert labels.image.tolist() == [NO_IMAGE]


def test_without_image_offsets_no_label_has_an_image() -> None:
    labels = labels_of([anchor("a", np.zeros(2))], FRAME, image_offsets=False)
    assert (labels.image.tolist(), labels.images) == ([NO_IMAGE], ())


def test_a_known_identity_is_tied_by_it_alone() -> None:
    labels = labels_of(
        [anchor("a", np.zeros(2), signature="7"), anchor("b", np.zeros(2), signature="9"), anchor("c", np.zeros(2))],
        FRAME,
        image_offsets=True,
    )
    found = by_signature(labels, ("", "7"))
    assert found.landmark.tolist() == [1, UNASSIGNED, UNASSIGNED]
    assert found.reason[1] == "no landmark of that signature"


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
