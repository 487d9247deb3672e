"""Coordinates of a source come to lie where they are, and headings turn with the grid."""

import math

import numpy as np
import pytest

from trigpoint.errors import FrameRefused
from trigpoint.geodesy.positions import GridPosition, Wgs84Position
from trigpoint.geodesy.projection import map_points_from_wgs84, pin_map_frame, pin_map_frame_at
from trigpoint_vehicle.core.source_frames import (
    geographic_frame,
    grid_headings_rad,
    local_frame_at,
    local_frame_on_grid,
    projected_frame,
    wgs84_from_source,
)

ANN_ARBOR = Wgs84Position(42.293227, -83.709657)
UTM_17N = "EPSG:32617"


def test_local_metres_to_true_north_keep_their_length_on_the_ground() -> None:
    lat_deg, lon_deg = wgs84_from_source(np.array([0.0, 0.0]), np.array([0.0, 1000.0]), local_frame_at(ANN_ARBOR))
    frame = pin_map_frame_at(ANN_ARBOR)
    (begin, end) = map_points_from_wgs84(lat_deg, lon_deg, frame)
    assert lon_deg[0] == pytest.approx(lon_deg[1], abs=1e-9)  # straight to the north
    # the scale changes by some ppm over the kilometre
    assert math.dist(begin, end) / frame.point_scale == pytest.approx(1000.0, abs=0.01)


def test_local_metres_along_a_grid_are_stretched_by_its_scale() -> None:
    origin = GridPosition(623_400.0, 4_848_700.0)
    lat_deg, lon_deg = wgs84_from_source(np.array([100.0]), np.array([0.0]), local_frame_on_grid(UTM_17N, origin))
    frame = pin_map_frame(crs=UTM_17N, origin=origin)
    (point_m,) = map_points_from_wgs84(lat_deg, lon_deg, frame)
    assert point_m == pytest.approx([100.0 * frame.point_scale, 0.0], abs=1e-6)


def test_true_north_is_not_grid_north_away_from_the_central_meridian() -> None:
    frame = pin_map_frame_at(ANN_ARBOR)
    here = np.array([0.0])
    north = np.array([math.pi / 2.0])
    (heading,) = grid_headings_rad(here, here, north, local_frame_at(ANN_ARBOR), map_crs=UTM_17N)
    # convergence is -1.8 degrees there; it varies by 0.01 degrees over the frame's rounding to a kilometre
    assert heading - math.pi / 2.0 == pytest.approx(frame.convergence_rad, abs=3e-4)
    assert abs(frame.convergence_rad) > 0.03


@pytest.mark.parametrize("heading_deg", [-170.0, -45.0, 0.0, 30.0, 90.0, 135.0])
def test_headings_from_degrees_and_from_true_metres_agree(heading_deg: float) -> None:
    heading = np.radians([heading_deg])
    (by_degrees,) = grid_headings_rad(
        np.array([ANN_ARBOR.lon_deg]), np.array([ANN_ARBOR.lat_deg]), heading, geographic_frame(), map_crs=UTM_17N
    )
    zero = np.array([0.0])
    (by_metres,) = grid_headings_rad(zero, zero, heading, local_frame_at(ANN_ARBOR), map_crs=UTM_17N)
    assert by_degrees == pytest.approx(by_metres, abs=1e-6)  # rad


def test_headings_on_the_maps_own_grid_stay_as_they_are() -> None:
    x, y, heading = np.array([276_500.0]), np.array([4_685_500.0]), np.array([2.5])
    assert grid_headings_rad(x, y, heading, projected_frame(UTM_17N), map_crs=UTM_17N) == pytest.approx(2.5, abs=1e-6)


def test_what_is_not_known_stays_unknown() -> None:
    x, y = np.array([1.0, math.nan]), np.array([2.0, 3.0])
    lat_deg, _ = wgs84_from_source(x, y, local_frame_at(ANN_ARBOR))
    heading = grid_headings_rad(x, y, np.array([math.nan, 0.0]), local_frame_at(ANN_ARBOR), map_crs=UTM_17N)
    assert np.isnan(lat_deg).tolist() == [False, True]
    assert np.isnan(heading).all()


@pytest.mark.parametrize("crs", ["EPSG:999999", "EPSG:4326", "EPSG:2263"])
def test_a_crs_unknown_or_in_degrees_or_in_feet_is_refused_by_name(crs: str) -> None:
    with pytest.raises(FrameRefused, match=crs):
        wgs84_from_source(np.array([10.0]), np.array([20.0]), projected_frame(crs))


def test_an_origin_off_the_earth_is_refused_with_its_value() -> None:
    with pytest.raises(FrameRefused, match="local origin 91.0, 0.0"):
        local_frame_at(Wgs84Position(91.0, 0.0))
