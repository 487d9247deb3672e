"""Areas and limits of a landmark query."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trigpoint.errors import InputError
from trigpoint.geodesy.projection import WGS84, geodesic_distances_m, transform_coordinates
from trigpoint.landmarks.geopackage_query import grid_window
from trigpoint.landmarks.queries import DegreeBox, Disc, LandmarkQuery, box_around

NAN = math.nan


def box(lon_min_deg: float, lat_min_deg: float, lon_max_deg: float, lat_max_deg: float) -> DegreeBox:
    return DegreeBox(lon_min_deg=lon_min_deg, lat_min_deg=lat_min_deg, lon_max_deg=lon_max_deg, lat_max_deg=lat_max_deg)


def test_a_bbox_inverted_in_longitude_is_refused_with_both_values() -> None:
    with pytest.raises(InputError, match="lon_min 152.0 is above lon_max 151.0"):
        box(152.0, -34.0, 151.0, -33.0)


def test_a_bbox_inverted_in_latitude_is_refused_with_both_values() -> None:
    with pytest.raises(InputError, match="lat_min -33.0 is above lat_max -34.0"):
        box(151.0, -33.0, 152.0, -34.0)


@pytest.mark.parametrize("corners", [(181.0, 0.0, 181.0, 0.0), (0.0, 91.0, 1.0, 91.0), (NAN, 0.0, 1.0, 1.0)])
def test_a_bbox_off_the_globe_is_refused(corners: tuple[float, float, float, float]) -> None:
    with pytest.raises(InputError, match="is outside -(180 to 180|90 to 90)"):
        box(*corners)


def test_latitude_91_is_refused_with_its_limit() -> None:
    with pytest.raises(InputError, match="latitude 91.0 is outside -90 to 90"):
        Disc(lat_deg=91.0, lon_deg=0.0, radius_m=1.0)


@pytest.mark.parametrize("radius_m", [0.0, -1.0, NAN, math.inf, 100_001.0])
def test_a_radius_outside_its_limits_is_refused_with_them(radius_m: float) -> None:
    with pytest.raises(InputError, match="is outside 0 to 100000 m"):
        Disc(lat_deg=0.0, lon_deg=0.0, radius_m=radius_m)


def test_a_limit_of_nothing_is_refused() -> None:
    with pytest.raises(InputError, match="limit 0 is under 1"):
        LandmarkQuery(limit=0)


@given(
    lat_deg=st.floats(-90.0, 90.0),
    lon_deg=st.floats(-180.0, 180.0),
    radius_m=st.floats(0.01, 100_000.0),
    offset=st.tuples(st.floats(-2.0, 2.0), st.floats(-4.0, 4.0)),
)
def test_the_box_around_a_disc_holds_all_of_it(
    lat_deg: float, lon_deg: float, radius_m: float, offset: tuple[float, float]
) -> None:
    disc = Disc(lat_deg=lat_deg, lon_deg=lon_deg, radius_m=radius_m)
    there_lat_deg = min(max(lat_deg + offset[0], -90.0), 90.0)
    there_lon_deg = (lon_deg + offset[1] + 180.0) % 360.0 - 180.0
    (distance_m,) = geodesic_distances_m(
        lat_deg, lon_deg, lat_deg=np.array([there_lat_deg]), lon_deg=np.array([there_lon_deg])
    )
    assert distance_m > radius_m or box_around(disc).contains(there_lat_deg, there_lon_deg)


SIZE_DEG = st.floats(0.0, 2.0)
SHARE = st.floats(0.0, 1.0)


@given(west=st.floats(150.0, 155.0), south=st.floats(-60.0, 60.0), size=st.tuples(SIZE_DEG, SIZE_DEG), x=SHARE, y=SHARE)
def test_the_grid_window_of_a_box_holds_all_of_it(
    west: float, south: float, size: tuple[float, float], x: float, y: float
) -> None:
    window = grid_window(box(west, south, west + size[0], south + size[1]), "EPSG:32656")
    lon_deg, lat_deg = np.array([west + x * size[0]]), np.array([south + y * size[1]])
    easting_m, northing_m = transform_coordinates(lon_deg, lat_deg, source_crs=WGS84, target_crs="EPSG:32656")
    assert window["window_min_x"] <= easting_m[0] <= window["window_max_x"]
    assert window["window_min_y"] <= northing_m[0] <= window["window_max_y"]


def test_a_degree_of_longitude_at_the_equator_is_measured_on_the_ellipsoid() -> None:
    (distance_m,) = geodesic_distances_m(0.0, 179.5, lat_deg=np.array([0.0]), lon_deg=np.array([-179.5]))
    # pi / 180 of the semi-major axis 6 378 137 m, across the antimeridian; rounding only.
    assert distance_m == pytest.approx(111_319.490_793, abs=1e-6)
