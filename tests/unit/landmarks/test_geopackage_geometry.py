"""Geometry bytes as the GeoPackage standard has them."""

import struct

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from trigpoint.errors import InputError
from trigpoint.landmarks import geopackage_geometry as geometry

COORDINATE = st.floats(allow_nan=False, allow_infinity=False)


def test_a_point_has_the_bytes_of_the_standard() -> None:
    # Magic, version 0, little endian without envelope, srs 32756, then WKB: byte order, type 1, x, y.
    by_hand = bytes.fromhex("4750 00 01 f47f0000 01 01000000 000000000000f03f 0000000000000040")
    assert geometry.encoded_point(1.0, 2.0, srs_id=32756) == by_hand


@given(COORDINATE, COORDINATE)
def test_a_point_comes_back_exactly(x: float, y: float) -> None:
    blob = geometry.encoded_point(x, y, srs_id=-1)
    assert geometry.decoded_point(blob) == (x, y)
    assert geometry.decoded(blob) == ((x, y),)


@given(st.lists(st.tuples(COORDINATE, COORDINATE), min_size=2, max_size=5))
def test_a_line_comes_back_exactly(points: list[tuple[float, float]]) -> None:
    assert geometry.decoded(geometry.encoded_line(points, srs_id=4326)) == tuple(points)


def test_a_line_carries_its_envelope() -> None:
    blob = geometry.encoded_line([(3.0, -1.0), (1.0, 5.0)], srs_id=4326)
    assert struct.unpack_from("<4d", blob, 8) == (1.0, 3.0, -1.0, 5.0)


def test_the_part_after_the_header_is_wkb_to_others() -> None:
    assert shapely.from_wkb(geometry.encoded_point(1.0, 2.0, srs_id=0)[8:]).wkt == "POINT (1 2)"


def test_a_point_written_by_others_with_envelope_and_big_endian_is_read() -> None:
    header = struct.pack(">2sBBi4d", b"GP", 0, 0b10, 32756, 1.0, 1.0, 2.0, 2.0)
    assert geometry.decoded_point(header + struct.pack(">BIdd", 0, 1, 1.0, 2.0)) == (1.0, 2.0)


def test_the_bounds_are_what_a_spatial_index_asks_for() -> None:
    blob = geometry.encoded_line([(3.0, -1.0), (1.0, 5.0)], srs_id=0)
    bounds = geometry.min_x(blob), geometry.max_x(blob), geometry.min_y(blob), geometry.max_y(blob)
    assert (bounds, geometry.is_empty(blob)) == ((1.0, 3.0, -1.0, 5.0), False)


def test_a_line_of_one_point_is_refused() -> None:
    with pytest.raises(InputError, match="a line of 1 points: 2 is the least"):
        geometry.encoded_line([(1.0, 2.0)], srs_id=0)


@pytest.mark.parametrize("length", [0, 1, 3, 7, 8, 12, 20, 28])
def test_a_geometry_cut_short_is_refused(length: int) -> None:
    with pytest.raises(InputError, match="geometry"):
        geometry.decoded_point(geometry.encoded_point(1.0, 2.0, srs_id=0)[:length])


def test_a_geometry_that_is_neither_point_nor_line_is_refused() -> None:
    blob = geometry.encoded_point(1.0, 2.0, srs_id=0)[:8] + shapely.to_wkb(shapely.box(0, 0, 1, 1))
    with pytest.raises(InputError, match="WKB type 3"):
        geometry.decoded(blob)
