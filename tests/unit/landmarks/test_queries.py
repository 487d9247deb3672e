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


@given(
    west=st.floats(150.0, 155.0), south=st.floats(-60.0, 60.0), width=st.floats(0.0, 2.0), height=st.floats(0.0, 2.0)
)
def test_the_grid_window_of_a_box_holds_all_of_it(west: float, south: float, width: float, height: float) -> None:
    whole = box(west, south, west + width, south + height)
    window = grid_window(whole, "EPSG:32656")
    part = box(west + 0.37 * width, south, west + 0.37 * width, south + 0.63 * height)  # also of its southern edge
    inner = grid_window(part, "EPSG:32656")
    margin_m = 1.0 + 0.01 * (inner["window_max_y"] - inner["window_min_y"])  # what inner itself adds around its part
    assert window["window_min_y"] <= inner["window_min_y"] + margin_m
    assert window["window_max_x"] >= inner["window_max_x"] - margin_m


def test_a_degree_of_longitude_at_the_equator_is_measured_on_the_ellipsoid() -> None:
    (distance_m,) = geodesic_distances_m(0.0, 179.5, lat_deg=np.array([0.0]), lon_deg=np.array([-179.5]))
    # pi / 180 of the semi-major axis 6 378 137 m, across the antimeridian; rounding only.
    assert distance_m == pytest.approx(111_319.490_793, abs=1e-6)
