"""Tiles of one image: those that contradict their neighbours are refused, the others give landmarks anchors."""

import json

import numpy as np
from numpy.typing import NDArray

from registered_images.examples import EAST_M, NORTH_M, SIDE_M, registered, tile
from trigpoint.geodesy.projection import WGS84, transform_coordinates
from trigpoint_tiles.core.check_layer import check_layer
from trigpoint_tiles.core.consensus import contradicted
from trigpoint_tiles.core.image_anchors import LANDMARK_SIGMA_M, PlacedLandmark, image_anchors
from trigpoint_tiles.core.image_tiles import TileRegistration, agreeing
from trigpoint_tiles.core.registration import unknown

Floats = NDArray[np.float64]


def pole(name: str, east_m: float) -> PlacedLandmark:
    return PlacedLandmark(landmark=name, kind="pole", easting_m=EAST_M + east_m, northing_m=NORTH_M)


def test_of_a_row_of_tiles_the_one_that_says_otherwise_is_refused() -> None:
    row = [tile(0, (2.0, 1.0)), tile(1, (2.1, 1.0)), tile(2, (2.9, 0.2)), tile(3, (2.2, 1.1))]
    assert [bool(one.registration.refused) for one in agreeing(row)] == [False, False, True, False]


def test_a_map_that_bends_a_metre_in_two_hundred_refuses_none() -> None:
    row = [tile(number, (0.25 * number, 0.0)) for number in range(9)]
    assert not any(one.registration.refused for one in agreeing(row))


def test_of_two_tiles_that_differ_nobody_knows_which_and_both_are_refused() -> None:
    assert all(one.registration.refused for one in agreeing([tile(0, (0.0, 0.0)), tile(1, (2.0, 0.0))]))


def test_tiles_too_far_apart_to_speak_of_each_other_stay() -> None:
    middle_m = np.array([[0.0, 0.0], [1000.0, 0.0]])
    against = contradicted(middle_m, np.array([[0.0, 0.0], [5.0, 0.0]]), np.tile(np.eye(2) * 1e-4, (2, 1, 1)))
    assert not against.any()


def test_an_anchor_is_the_landmark_and_the_shift_of_its_tile() -> None:
    (found,) = image_anchors([tile(0, (1.5, -0.5)), tile(1, (9.0, 9.0))], [pole("a", 3.0)])
    assert (found.landmark, found.kind) == ("a", "pole")
    assert np.allclose([found.easting_m, found.northing_m], [EAST_M + 4.5, NORTH_M - 0.5])


def test_many_anchors_of_one_tile_say_no_more_of_the_shift_than_the_tile() -> None:
    many = image_anchors([tile(0, (0.0, 0.0), sigma_m=0.2)], [pole(f"p{n}", 0.1 * n) for n in range(50)])
    of_all_m2 = 1.0 / sum(1.0 / one.sigma_m**2 for one in many)
    assert np.isclose(of_all_m2, 0.2**2 + LANDMARK_SIGMA_M**2 / 50)


def test_a_tile_known_worse_along_its_street_gives_anchors_that_sigma() -> None:
    along = tile(0, (0.0, 0.0))
    along.registration.covariance_m2[:] = [[0.09, 0.0], [0.0, 0.0001]]
    (found,) = image_anchors([along], [pole("a", 0.0)])
    assert np.isclose(found.sigma_m, np.hypot(0.3, LANDMARK_SIGMA_M))


def test_refused_tiles_and_places_outside_all_tiles_give_no_anchor() -> None:
    tiles = [tile(0, (0.0, 0.0), refused="dark")]
    assert image_anchors(tiles, [pole("a", 0.0), pole("b", 500.0)]) == ()


def test_the_check_layer_says_of_each_tile_its_shift_or_why_it_has_none() -> None:
    refused = TileRegistration(
        easting_m=EAST_M, northing_m=NORTH_M, width_m=SIDE_M, height_m=SIDE_M, registration=unknown("dark")
    )
    told, why = json.loads(check_layer(registered(tile(1, (0.3, 0.4)), refused), image="north"))["features"]
    assert (told["properties"]["shift_east_m"], told["properties"]["length_m"]) == (0.3, 0.5)
    assert (told["properties"]["image"], told["properties"]["map_version"]) == ("north", 3)
    assert (why["properties"]["refused"], why["properties"]["sigma_east_m"]) == ("dark", None)
    assert (why["properties"]["shown_lon_deg"], why["properties"]["shown_lat_deg"]) == (None, None)


def test_the_check_layer_says_in_degrees_where_the_image_shows_the_middle_of_a_tile() -> None:
    (told,) = json.loads(check_layer(registered(tile(1, (0.3, 0.4))), image="north"))["features"]
    shown = np.array([[told["properties"]["shown_lon_deg"]], [told["properties"]["shown_lat_deg"]]])
    easting_m, northing_m = transform_coordinates(*shown, source_crs=WGS84, target_crs="EPSG:32756")
    found_m = (easting_m[0] - EAST_M - SIDE_M, northing_m[0] - NORTH_M)
    assert np.allclose(found_m, (0.3, 0.4), atol=0.001)  # m: degrees are rounded to 0.1 mm
