"""Labels find their landmarks by the solve's own rule, or stay unassigned and say why."""

import math

import numpy as np
from numpy.typing import NDArray

from anchored_maps.examples import LABEL_SIGMA_M, labels_at
from driven_paths.examples import FRAME
from trigpoint.anchoring.association import (
    UNASSIGNED,
    Assignment,
    AssociationLimits,
    MapKnowledge,
    by_signature,
    nearest_assignment,
    neighbours_of,
)
from trigpoint.anchoring.labels import NO_IMAGE, labels_of
from trigpoint.events.corrected import AnchorLabelled
from trigpoint.geodesy.projection import wgs84_from_map_points

Floats = NDArray[np.float64]

LIMITS = AssociationLimits(gate_sigmas=3.5, second_ratio=2.0)
EXPECTED_SIGMA_M = 0.3  # of a label around its landmark


def known(landmark_m: Floats) -> MapKnowledge:
    """Landmarks so sure that a label is expected within `EXPECTED_SIGMA_M`, and no image."""
    return MapKnowledge(
        landmark_m=landmark_m,
        landmark_variance_m2=np.full(len(landmark_m), EXPECTED_SIGMA_M**2 - LABEL_SIGMA_M**2),
        image_m=np.zeros((0, 2)),
        image_variance_m2=np.zeros(0),
    )


def nearest(label_m: Floats, landmark_m: Floats) -> Assignment:
    return nearest_assignment(labels_at(label_m), known(landmark_m), limits=LIMITS)


def test_the_gate_holds_the_variances_of_landmark_image_and_label() -> None:
    knowledge = MapKnowledge(
        landmark_m=np.zeros((1, 2)),
        landmark_variance_m2=np.array([0.04]),
        image_m=np.zeros((1, 2)),
        image_variance_m2=np.array([0.11]),
    )
    around = neighbours_of(labels_at(np.array([[0.1, 0.0]]), image=0), knowledge, limits=LIMITS)
    assert math.isclose(around.gate_m[0], 3.5 * 0.4)  # 0.04 + 0.11 + 0.1^2 m^2
    assert (around.second[0], around.second_m[0]) == (UNASSIGNED, math.inf)


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
    knowledge = MapKnowledge(
        landmark_m=np.zeros((1, 2)),
        landmark_variance_m2=np.zeros(1),
        image_m=np.array([[3.0, 0.0]]),
        image_variance_m2=np.zeros(1),
    )
    found = nearest_assignment(labels, knowledge, limits=LIMITS)
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
