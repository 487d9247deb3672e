"""What people type, and what they get back."""

import json

import pytest

from landmark_maps.examples import landmark
from trigpoint.errors import InputError
from trigpoint.landmarks.geojson import change_list, feature_collection, landmark_list
from trigpoint.landmarks.model import LandmarkChanges
from trigpoint_landmarks.core.questions import bbox_of, near_of


def test_a_bbox_is_longitude_first() -> None:
    box = bbox_of("151.1, -33.9,151.2,-33.8")
    assert (box.lon_min_deg, box.lat_min_deg, box.lon_max_deg, box.lat_max_deg) == (151.1, -33.9, 151.2, -33.8)


def test_a_position_is_latitude_first() -> None:
    disc = near_of("-33.9,151.2", radius_m=50.0)
    assert (disc.lat_deg, disc.lon_deg, disc.radius_m) == (-33.9, 151.2, 50.0)


@pytest.mark.parametrize("text", ["", "1,2,3", "1,2,3,4,5", "151.1;-33.9;151.2;-33.8"])
def test_a_bbox_of_other_than_four_numbers_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="lon_min,lat_min,lon_max,lat_max has 4"):
        bbox_of(text)


@pytest.mark.parametrize(("text", "said"), [("1,x,3,4", "'x' in"), ("1,nan,3,4", "not finite"), ("1,,3,4", "'' in")])
def test_a_bbox_of_no_numbers_is_refused_with_the_part(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        bbox_of(text)


def test_a_bbox_typed_latitude_first_is_refused_by_its_latitude() -> None:
    with pytest.raises(InputError, match="latitude 151.1 is outside -90 to 90"):
        bbox_of("-33.9,151.1,-33.8,151.2")


def test_a_position_at_latitude_91_is_refused() -> None:
    with pytest.raises(InputError, match="latitude 91.0 is outside -90 to 90"):
        near_of("91,0", radius_m=10.0)


def test_a_feature_is_longitude_first_and_names_its_units() -> None:
    row = landmark("L1", 0.0, 0.0)
    (feature,) = json.loads(json.dumps(feature_collection([row], map_version=3)))["features"]
    # Nine decimals of a degree are 0.1 mm.
    assert feature["geometry"]["coordinates"] == pytest.approx([row.lon_deg, row.lat_deg], abs=1e-9)
    assert {"sigma_major_m", "sigma_minor_m", "ellipse_heading_rad", "covariance_m2"} <= feature["properties"].keys()
    assert (feature["type"], feature["id"], feature["properties"]["sigma_major_m"]) == ("Feature", "L1", 0.3)


def test_an_empty_answer_is_still_a_collection() -> None:
    assert feature_collection([], map_version=None)["features"] == []


def test_a_list_counts_its_landmarks() -> None:
    answer = json.loads(json.dumps(landmark_list([landmark("L1", 0.0, 0.0)], map_version=1)))
    assert (answer["map_version"], answer["landmarks"]["count"]) == (1, 1)
    assert answer["landmarks"]["items"][0]["lat_deg"] == pytest.approx(-33.895, abs=1e-3)  # degrees: in Sydney


def test_changes_name_both_versions() -> None:
    changes = LandmarkChanges(since=1, as_of=4, changed=(landmark("L1", 0.0, 0.0),), removed=("L2",))
    answer = change_list(changes)
    assert (answer["since"], answer["map_version"], answer["removed"]) == (1, 4, {"count": 1, "items": ["L2"]})
