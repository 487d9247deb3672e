"""Web Mercator tiles."""

from hypothesis import given
from hypothesis import strategies as st

from trigpoint.geodesy.positions import Wgs84Position
from trigpoint.geodesy.web_tiles import tile_at


@given(st.floats(-90.0, 90.0), st.floats(-180.0, 180.0), st.integers(0, 22))
def test_every_position_lies_in_a_tile_of_the_grid(lat_deg: float, lon_deg: float, zoom: int) -> None:
    tile = tile_at(Wgs84Position(lat_deg, lon_deg), zoom)
    assert 0 <= tile.column < 2**zoom
    assert 0 <= tile.row < 2**zoom


def test_the_equator_and_greenwich_meet_at_the_corner_of_four_tiles() -> None:
    south_east = tile_at(Wgs84Position(-1e-9, 1e-9), 1)
    north_west = tile_at(Wgs84Position(1e-9, -1e-9), 1)
    assert (south_east.column, south_east.row, north_west.column, north_west.row) == (1, 1, 0, 0)
