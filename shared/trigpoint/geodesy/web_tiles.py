"""Web Mercator tiles: the squares of the map a subscription can name."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.geodesy.positions import Wgs84Position

Floats = NDArray[np.float64]

EARTH_RADIUS_M = 6_378_137.0  # of Web Mercator's sphere
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
    """Longitude and latitude in degrees of a place on the tiles' grid; whole numbers: a tile's north-western corner."""
    count = 1 << zoom
    return 360.0 * column / count - 180.0, math.degrees(math.atan(math.sinh(math.pi * (1.0 - 2.0 * row / count))))


def tile_coordinates(lat_deg: Floats, lon_deg: Floats, zoom: int) -> tuple[Floats, Floats]:
    """Columns and rows (n,) of positions, with the fraction of the tile they lie at."""
    count = 1 << zoom
    lat_rad = np.radians(np.clip(lat_deg, -MERCATOR_LIMIT_DEG, MERCATOR_LIMIT_DEG))
    column = (lon_deg + 180.0) / 360.0 * count
    row = (1.0 - np.arcsinh(np.tan(lat_rad)) / math.pi) / 2.0 * count
    return np.asarray(column), np.asarray(row)


def tile_size_m(lat_deg: Floats, zoom: int) -> Floats:
    """The ground metres (n,) of a tile's side at latitudes (n,), on the sphere: to 0.4 %."""
    return np.asarray(2.0 * math.pi * EARTH_RADIUS_M * np.cos(np.radians(lat_deg)) / (1 << zoom))


def tile_edges_deg(tile: WebTile) -> tuple[float, float, float, float]:
    """The tile's edges: west, south, east, north in degrees."""
    west, north = corner_of(tile.zoom, tile.column, tile.row)
    east, south = corner_of(tile.zoom, tile.column + 1, tile.row + 1)
    return west, south, east, north
