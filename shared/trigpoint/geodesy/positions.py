"""The three kinds of position, one type a frame, so that they cannot be mixed up."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Wgs84Position:
    """Geodetic position: latitude and longitude in degrees on WGS84."""

    lat_deg: float
    lon_deg: float


@dataclass(frozen=True, slots=True)
class GridPosition:
    """Projected position: easting and northing in metres of the map's pinned CRS."""

    easting_m: float
    northing_m: float


@dataclass(frozen=True, slots=True)
class MapPosition:
    """Position in the map frame: metres east and north (grid axes) of the map's origin."""

    x_m: float
    y_m: float
