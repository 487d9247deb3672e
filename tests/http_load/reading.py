"""A served map read back by GDAL: every landmark, in degrees and on the grid, and those of a tile."""

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyogrio
from numpy.typing import NDArray
from shapely import from_wkb, get_coordinates

from landmark_maps.examples import change, checkpoint
from map_features.examples import crowd
from map_http.served import geopackage_line, served_map
from trigpoint.geodesy.positions import Wgs84Position
from trigpoint.geodesy.web_tiles import corner_of, tile_at
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint.landmarks.model import Landmark

ZOOM = 15
METRES_PER_DEGREE = 111_320.0
MERCATOR_M = 40_075_016.685578488
MIDDLE = Wgs84Position(-33.893, 151.184)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadBack:
    """Landmarks not read, and how far from its place the worst one is: by pages in m, by a tile in its units."""

    missing: int
    off_m: float
    tile_missing: int
    tile_off_units: float


def read_back(folder: Path) -> ReadBack:
    """The landmarks of a map as GDAL gives them, in both orders of axes and on the map's own grid."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = {row.landmark: row for row in crowd()}
    path = folder / "map.gpkg"
    with closing(GeoPackageStore(path)) as store:
        store.apply(change(1, opened=list(rows.values())), checkpoint(1))
    with served_map(folder, database=geopackage_line(path)) as served:
        source = f"OAPIF:{served.url}"
        degrees = [_read(source, layer="landmarks", CRS=crs) for crs in ("OGC:CRS84", "EPSG:4326")]
        grid = _read(source, layer="landmarks", CRS="EPSG:32756")
        tile = tile_at(MIDDLE, ZOOM)
        drawn = _read(f"MVT:{served.url}/tiles/landmarks/{ZOOM}/{tile.column}/{tile.row}.pbf")
    in_degrees = [[(rows[name].lon_deg, rows[name].lat_deg) for name in names] for names, _ in degrees]
    on_grid = [(rows[name].easting_m, rows[name].northing_m) for name in grid[0]]
    off_m = [
        *(METRES_PER_DEGREE * _apart(at, expected) for (_, at), expected in zip(degrees, in_degrees, strict=True)),
        _apart(grid[1], on_grid),
    ]
    west, north = corner_of(ZOOM, tile.column, tile.row)
    east, south = corner_of(ZOOM, tile.column + 1, tile.row + 1)
    inside = {row.landmark for row in rows.values() if _is_inside(row, (west, south, east, north))}
    unit_m = MERCATOR_M / 2**ZOOM / 4096
    return ReadBack(
        missing=max(len(rows.keys() - set(names)) for names, _ in (*degrees, grid)),
        off_m=max(off_m),
        tile_missing=len(inside - set(drawn[0])),
        tile_off_units=_apart(drawn[1], [_mercator_m(rows[name]) for name in drawn[0]]) / unit_m,
    )


def _read(source: str, **options: Any) -> tuple[list[str], NDArray[np.float64]]:
    """Ids, and coordinates (n, 2)."""
    meta, _, geometries, columns = pyogrio.raw.read(source, **options)
    names = [str(name) for name in meta["fields"]]
    return list(columns[names.index("landmark")]), get_coordinates(from_wkb(geometries))


def _apart(found: NDArray[np.float64], expected: list[tuple[float, float]]) -> float:
    return float(np.abs(found - np.array(expected)).max())


def _is_inside(row: Landmark, box: tuple[float, float, float, float]) -> bool:
    west, south, east, north = box
    return west < row.lon_deg < east and south < row.lat_deg < north


def _mercator_m(row: Landmark) -> tuple[float, float]:
    radius_m = MERCATOR_M / (2.0 * np.pi)
    return (
        float(radius_m * np.radians(row.lon_deg)),
        float(radius_m * np.arcsinh(np.tan(np.radians(row.lat_deg)))),
    )
