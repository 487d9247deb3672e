"""An image's registration as a layer of GIS programs: a point for each tile, with its shift and what it is worth."""

import json

import numpy as np

from trigpoint.geodesy.projection import WGS84, transform_coordinates
from trigpoint_tiles.core.image_tiles import ImageRegistration, TileRegistration

DEGREE_DECIMALS, METRE_DECIMALS = 9, 4
COLUMNS = {
    "image": "TEXT",
    "map_version": "INTEGER",
    "shift_east_m": "REAL",
    "shift_north_m": "REAL",
    "sigma_east_m": "REAL",
    "sigma_north_m": "REAL",
    "correlation": "REAL",
    "length_m": "REAL",
    "towards_deg": "REAL",
    "shown_lon_deg": "REAL",
    "shown_lat_deg": "REAL",
    "confidence": "REAL",
    "refused": "TEXT",
}  # of a tile, with their types in SQL

Values = dict[str, str | float | int | None]


def check_layer(found: ImageRegistration, *, image: str) -> str:
    """The tiles as GeoJSON (RFC 7946), refused ones with their reason and without a shift."""
    features = [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": [lon_deg, lat_deg]},
            "properties": values,
        }
        for (lon_deg, lat_deg), values in zip(
            _degrees(found, shifted=False), check_values(found, image=image), strict=True
        )
    ]
    return json.dumps({"type": "FeatureCollection", "features": features}, indent=1, allow_nan=False) + "\n"


def check_values(found: ImageRegistration, *, image: str) -> list[Values]:
    """What is said of each tile, by `COLUMNS`: shifts along the grid of the layer's CRS, where the image shows what the
    layer has in the tile's middle in degrees, and of refused ones the reason alone."""
    return [
        {"image": image, "map_version": found.map_version, **_values(tile, shown)}
        for tile, shown in zip(found.tiles, _degrees(found, shifted=True), strict=True)
    ]


def _values(tile: TileRegistration, shown_deg: tuple[float, float]) -> Values:
    told = tile.registration
    covariance_m2 = told.covariance_m2
    numbers = {
        "shift_east_m": told.shift_m[0],
        "shift_north_m": told.shift_m[1],
        "sigma_east_m": told.sigma_m[0],
        "sigma_north_m": told.sigma_m[1],
        "correlation": covariance_m2[0, 1] / np.sqrt(covariance_m2[0, 0] * covariance_m2[1, 1]),
        "length_m": np.hypot(*told.shift_m),
        "towards_deg": np.degrees(np.arctan2(told.shift_m[0], told.shift_m[1])) % 360.0,
    }
    rounded = {name: round(float(value), METRE_DECIMALS) for name, value in numbers.items()}
    shown = {**rounded, "shown_lon_deg": shown_deg[0], "shown_lat_deg": shown_deg[1]}
    return {
        **(dict.fromkeys(shown) if told.refused else shown),
        "confidence": round(told.confidence, METRE_DECIMALS),
        "refused": told.refused or None,
    }


def _degrees(found: ImageRegistration, *, shifted: bool) -> list[tuple[float, float]]:
    """Longitude and latitude of the tiles' middles, where the layer has them or by their shift where the image does;
    refused ones stay where they are."""
    middle_m = np.array([(tile.easting_m, tile.northing_m) for tile in found.tiles]).reshape(-1, 2)
    if shifted:
        told = [tile.registration for tile in found.tiles]
        middle_m = middle_m + np.array([np.zeros(2) if one.refused else one.shift_m for one in told]).reshape(-1, 2)
    lon_deg, lat_deg = transform_coordinates(*middle_m.T, source_crs=found.crs, target_crs=WGS84)
    rounded = np.column_stack([lon_deg, lat_deg]).round(DEGREE_DECIMALS)
    return [(float(lon), float(lat)) for lon, lat in rounded]
