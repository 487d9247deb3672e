"""An image's registration as a layer of GIS programs: a point for each tile, with its shift and what it is worth."""

import json

import numpy as np

from trigpoint.geodesy.projection import WGS84, transform_coordinates
from trigpoint_tiles.core.image_tiles import ImageRegistration, TileRegistration

DEGREE_DECIMALS, METRE_DECIMALS = 9, 4


def check_layer(found: ImageRegistration, *, image: str) -> str:
    """The tiles as GeoJSON (RFC 7946), refused ones with their reason and without a shift."""
    easting_m, northing_m = (
        np.array([getattr(one, name) for one in found.tiles]) for name in ("easting_m", "northing_m")
    )
    lon_deg, lat_deg = transform_coordinates(easting_m, northing_m, source_crs=found.crs, target_crs=WGS84)
    features = [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": [round(lon, DEGREE_DECIMALS), round(lat, DEGREE_DECIMALS)]},
            "properties": {"image": image, "map_version": found.map_version, **_properties(tile)},
        }
        for tile, lon, lat in zip(found.tiles, lon_deg.tolist(), lat_deg.tolist(), strict=True)
    ]
    return json.dumps({"type": "FeatureCollection", "features": features}, indent=1, allow_nan=False) + "\n"


def _properties(tile: TileRegistration) -> dict[str, object]:
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
    shown = {name: None if told.refused else round(float(value), METRE_DECIMALS) for name, value in numbers.items()}
    return {**shown, "confidence": round(told.confidence, METRE_DECIMALS), "refused": told.refused or None}
