"""Where on the map's grid a box of degrees is to be looked up."""

from functools import lru_cache

import numpy as np

from trigpoint.geodesy.projection import WGS84, transform_coordinates
from trigpoint.landmarks.feature_query import GridBox, MapState
from trigpoint.landmarks.geopackage_query import WIDEST_INDEXED_DEG, grid_window
from trigpoint.landmarks.queries import DegreeBox

REACH_DEG = 5.0  # boxes this near the map's origin are looked up on its grid; a wider one holds most of the map


def indexed_window(box: DegreeBox, state: MapState) -> GridBox | None:
    """A window of the grid that holds the whole box; None for one so wide or so far that its columns must serve."""
    lon_deg, lat_deg = _origin_deg(state.crs, state.origin_easting_m, state.origin_northing_m)
    near = abs(box.lon_min_deg - lon_deg) < REACH_DEG and abs(box.lon_max_deg - lon_deg) < REACH_DEG
    near = near and abs(box.lat_min_deg - lat_deg) < REACH_DEG and abs(box.lat_max_deg - lat_deg) < REACH_DEG
    if not near or box.lon_max_deg - box.lon_min_deg > WIDEST_INDEXED_DEG:
        return None
    window = grid_window(box, state.crs)
    return GridBox(
        easting_min_m=window["window_min_x"],
        northing_min_m=window["window_min_y"],
        easting_max_m=window["window_max_x"],
        northing_max_m=window["window_max_y"],
    )


@lru_cache(maxsize=16)
def _origin_deg(crs: str, easting_m: float, northing_m: float) -> tuple[float, float]:
    """Longitude and latitude of a map's origin."""
    lon_deg, lat_deg = transform_coordinates(
        np.array([easting_m]), np.array([northing_m]), source_crs=crs, target_crs=WGS84
    )
    return float(lon_deg[0]), float(lat_deg[0])
