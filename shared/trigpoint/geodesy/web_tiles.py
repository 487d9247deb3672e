"""Web Mercator tiles: the squares of the map a subscription can name."""

import math
from dataclasses import dataclass

from trigpoint.geodesy.positions import Wgs84Position

MERCATOR_LIMIT_DEG = 85.051128779806592  # latitude where Web Mercator's square ends (EPSG:3857)


@dataclass(frozen=True, slots=True)
class WebTile:
    """A tile: zoom, column counted east from the antimeridian, row counted south from the northern edge."""

    zoom: int
    column: int
    row: int


def tile_at(position: Wgs84Position, zoom: int) -> WebTile:
    """The tile a position lies in; positions beyond the Mercator limit fall into the outermost row."""
    count = 1 << zoom
    lat_rad = math.radians(max(-MERCATOR_LIMIT_DEG, min(MERCATOR_LIMIT_DEG, position.lat_deg)))
    column = math.floor((position.lon_deg + 180.0) / 360.0 * count)
    row = math.floor((1.0 - math.asinh(math.tan(lat_rad)) / math.pi) / 2.0 * count)
    return WebTile(zoom, min(max(column, 0), count - 1), min(max(row, 0), count - 1))


def corner_of(zoom: int, column: float, row: float) -> tuple[float, float]:
    """Longitude and latitude in degrees of a place on the tiles' grid; whole numbers are tiles' north-western corners."""
    count = 1 << zoom
    return 360.0 * column / count - 180.0, math.degrees(math.atan(math.sinh(math.pi * (1.0 - 2.0 * row / count))))
