"""Vector tiles drawn in Python, feature for feature what PostGIS draws."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import clip_by_rect
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from trigpoint.geodesy.projection import WGS84, transform_coordinates
from trigpoint.geodesy.web_tiles import WebTile
from trigpoint.landmarks.layers import LANDMARKS, Layer
from trigpoint.landmarks.tile_grid import (
    BUFFER,
    CELL,
    EXTENT,
    PRECEDENCE,
    TILE_PROPERTIES,
    is_crowded,
    tile_frame,
)
from trigpoint.landmarks.vector_tiles import TileFeature, TilePoints, Value, encoded_layer

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]


def drawn_points(layer: Layer, tile: WebTile, rows: Sequence[Sequence[Any]]) -> bytes:
    """The tile of rows of properties, then longitude and latitude; in a crowd one stands for all of a cell."""
    if not rows:
        return b""
    degrees = np.array([row[-2:] for row in rows], dtype=np.float64)
    units = _units(degrees[:, 0], degrees[:, 1], tile)
    inside = np.flatnonzero(np.all((units >= -BUFFER) & (units < EXTENT + BUFFER), axis=1)).tolist()
    shown = _first_of_cells(layer, rows, units, inside) if is_crowded(layer, tile) else [(one, 0) for one in inside]
    features = [
        TileFeature([[tuple(units[index].tolist())]], _properties(layer, rows[index], left_out))
        for index, left_out in shown
    ]
    return encoded_layer(layer.name, features, extent=EXTENT)


def drawn_lines(
    layer: Layer, tile: WebTile, rows: Iterable[tuple[Sequence[tuple[float, float]], Sequence[Any]]], map_crs: str
) -> bytes:
    """The tile of rows of a line on the map's grid and its properties; lines are cut at the tile's buffer."""
    features = []
    for path, values in rows:
        parts = list(_parts(path, tile, map_crs))
        if parts:
            named = dict(zip(TILE_PROPERTIES[layer.name], values, strict=True))
            features.append(TileFeature(parts, named, is_line=True))
    return encoded_layer(layer.name, features, extent=EXTENT)


def _units(lon_deg: Floats, lat_deg: Floats, tile: WebTile) -> Whole:
    """Positions (n,) as whole units (n, 2) of a tile, to the east and to the south."""
    frame = tile_frame(tile)
    east = np.rint((lon_deg + 180) / 360 * frame.world).astype(np.int64) - frame.left
    south = (
        np.rint((1 - np.arcsinh(np.tan(np.radians(lat_deg))) / np.pi) / 2 * frame.world).astype(np.int64) - frame.top
    )
    return np.column_stack([east, south])


def _first_of_cells(
    layer: Layer, rows: Sequence[Sequence[Any]], units: Whole, inside: list[int]
) -> list[tuple[int, int]]:
    """The row that stands for each cell's, and how many it stands for besides itself."""
    columns = [TILE_PROPERTIES[layer.name].index(name) for name in PRECEDENCE[layer.name]]
    cells: dict[tuple[int, int], list[int]] = {}
    places = ((units + BUFFER) // CELL).tolist()
    for index in inside:
        cells.setdefault(tuple(places[index]), []).append(index)
    return [
        (min(members, key=lambda index: [rows[index][column] for column in columns]), len(members) - 1)
        for members in cells.values()
    ]


def _properties(layer: Layer, row: Sequence[Any], left_out: int) -> dict[str, Value | None]:
    values = dict(zip(TILE_PROPERTIES[layer.name], [*row[:-2], left_out], strict=True))
    if layer is LANDMARKS:
        values["anchored"] = bool(values["anchored"])
    return values


def _parts(path: Sequence[tuple[float, float]], tile: WebTile, map_crs: str) -> Iterator[TilePoints]:
    """The pieces of a line in a tile's units, without places that fall on the one before."""
    x_m, y_m = np.array(path, dtype=np.float64).T
    lon_deg, lat_deg = transform_coordinates(x_m, y_m, source_crs=map_crs, target_crs=WGS84)
    units = _without_repeats(_units(lon_deg, lat_deg, tile))
    if len(units) < 2:
        return
    reach = EXTENT + BUFFER
    for piece in _lines_in(clip_by_rect(LineString(units), -BUFFER, -BUFFER, reach, reach)):
        places = _without_repeats(np.rint(np.array(piece.coords)).astype(np.int64))
        if len(places) > 1:
            yield [(x, y) for x, y in places.tolist()]


def _without_repeats(units: Whole) -> Whole:
    moved = np.concatenate([[True], np.any(np.diff(units, axis=0) != 0, axis=1)])
    return np.asarray(units[moved], dtype=np.int64)


def _lines_in(shape: BaseGeometry) -> list[LineString]:
    if isinstance(shape, LineString):
        return [] if shape.is_empty else [shape]
    return [part for part in getattr(shape, "geoms", ()) if isinstance(part, LineString)]
