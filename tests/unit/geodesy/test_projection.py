"""The map frame and the ways into and out of it."""

import math
import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trigpoint.errors import FrameRefused
from trigpoint.geodesy.positions import GridPosition, MapPosition, Wgs84Position
from trigpoint.geodesy.projection import (
    map_from_wgs84,
    map_points_from_wgs84,
    pin_map_frame,
    pin_map_frame_at,
    transform_coordinates,
    utm_crs,
    wgs84_from_map,
    wgs84_from_map_points,
)

SYDNEY = Wgs84Position(-33.889, 151.193)
ORIGIN = GridPosition(332000.0, 6248000.0)
FRAME = pin_map_frame(crs="EPSG:32756", origin=ORIGIN)


def test_sydney_is_turned_and_shrunk_as_the_grid_says() -> None:
    frame = pin_map_frame_at(SYDNEY)
    assert math.degrees(frame.convergence_rad) == pytest.approx(1.01, abs=0.01)  # degrees; zone 56 at Sydney
    # By hand: 0.9996 (1 + x^2 / 2R^2), x = -168 067 m from the central meridian, R^2 = 4.0576e13 m^2 at that latitude.
    assert (frame.point_scale - 1.0) * 1e6 == pytest.approx(-52.06, abs=0.1)  # ppm; the series' next term is 0.05


def test_a_frame_pinned_at_a_position_has_a_round_origin_below_it() -> None:
    frame = pin_map_frame_at(SYDNEY)
    position = map_from_wgs84(SYDNEY, frame)
    assert (frame.origin_easting_m % 1000.0, frame.origin_northing_m % 1000.0) == (0.0, 0.0)
    assert 0.0 <= position.x_m < 1000.0
    assert 0.0 <= position.y_m < 1000.0


@given(x_m=st.floats(-20e3, 20e3), y_m=st.floats(-20e3, 20e3))
def test_a_position_comes_back_from_degrees(x_m: float, y_m: float) -> None:
    back = map_from_wgs84(wgs84_from_map(MapPosition(x_m, y_m), FRAME), FRAME)
    assert math.hypot(back.x_m - x_m, back.y_m - y_m) < 1e-6  # m: float64 at a northing of 6e6 m, and PROJ's own series


def test_points_and_single_positions_agree() -> None:
    lat_deg, lon_deg = wgs84_from_map_points(np.array([[120.0, -45.0]]), FRAME)
    one = wgs84_from_map(MapPosition(120.0, -45.0), FRAME)
    assert (lat_deg[0], lon_deg[0]) == (one.lat_deg, one.lon_deg)


def test_a_drive_across_the_edge_of_a_zone_keeps_its_frame() -> None:
    edge_lon_deg = 150.0  # between zones 55 and 56
    frame = pin_map_frame_at(Wgs84Position(-33.9, edge_lon_deg + 1e-5))
    point_m = map_points_from_wgs84(np.full(2, -33.9), np.array([edge_lon_deg - 1e-5, edge_lon_deg + 1e-5]), frame)
    assert np.linalg.norm(point_m[1] - point_m[0]) == pytest.approx(1.85, abs=0.01)  # m: 2e-5 degrees at that latitude


def test_a_drive_across_the_equator_keeps_its_frame() -> None:
    frame = pin_map_frame_at(Wgs84Position(1e-5, 32.5))
    point_m = map_points_from_wgs84(np.array([-1e-5, 1e-5]), np.full(2, 32.5), frame)
    assert point_m[1, 1] - point_m[0, 1] == pytest.approx(2.21, abs=0.01)  # m: 2e-5 degrees of latitude


@pytest.mark.parametrize(
    ("lat_deg", "lon_deg", "crs"),
    [
        (-33.9, 151.2, "EPSG:32756"),
        (42.3, -83.7, "EPSG:32617"),
        (0.0, 180.0, "EPSG:32601"),
        (0.0, -180.0, "EPSG:32601"),
    ],
)
def test_a_position_lies_in_its_zone(lat_deg: float, lon_deg: float, crs: str) -> None:
    assert utm_crs(Wgs84Position(lat_deg, lon_deg)) == crs


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:2263", "EPSG:4978"])
def test_a_crs_that_is_not_projected_in_metres_is_refused(crs: str) -> None:
    with pytest.raises(FrameRefused, match=crs):
        pin_map_frame(crs=crs, origin=ORIGIN)


def test_an_unknown_crs_is_refused_with_its_name() -> None:
    with pytest.raises(FrameRefused, match="EPSG:999999"):
        pin_map_frame(crs="EPSG:999999", origin=ORIGIN)


def test_a_crs_of_another_celestial_body_is_refused() -> None:
    with pytest.raises(FrameRefused, match="IAU_2015:30110"):
        pin_map_frame(crs="IAU_2015:30110", origin=ORIGIN)


def test_a_position_is_not_taken_to_another_celestial_body() -> None:
    with pytest.raises(FrameRefused, match="nothing leads from EPSG:4326 to IAU_2015:30110"):
        transform_coordinates(np.array([0.0]), np.array([0.0]), source_crs="EPSG:4326", target_crs="IAU_2015:30110")


def test_a_crs_whose_best_operation_needs_a_grid_is_pinned_without_a_warning() -> None:
    frame = pin_map_frame(crs="EPSG:27700", origin=GridPosition(400000.0, 100000.0))
    assert frame.operation_accuracy_m > 0.0


def test_a_position_outside_the_projection_is_refused() -> None:
    with pytest.raises(FrameRefused):
        transform_coordinates(np.array([0.0]), np.array([91.0]), source_crs="EPSG:4326", target_crs="EPSG:32756")


def test_threads_agree_with_one_another() -> None:
    found: list[MapPosition] = []
    threads = [threading.Thread(target=lambda: found.append(map_from_wgs84(SYDNEY, FRAME))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [map_from_wgs84(SYDNEY, FRAME)] * 4
