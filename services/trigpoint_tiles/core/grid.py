"""The pixels a raster has: squares of a projected CRS, counted from a fixed corner, in tiles of 256 a side."""

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.geodesy.positions import Wgs84Position
from trigpoint.geodesy.projection import crs_unit
from trigpoint.geodesy.web_tiles import EARTH_RADIUS_M, tile_size_m

Floats = NDArray[np.float64]

TILE_BITS = 8
TILE_PX = 1 << TILE_BITS
WEB_MERCATOR = "EPSG:3857"
ZOOM_MOST = 24
RESOLUTION_LEAST_M, RESOLUTION_MOST_M = 0.01, 100.0


@dataclass(frozen=True, slots=True, order=True)
class Tile:
    """A tile of a grid: column counted east, row counted south from the grid's corner; both may be negative."""

    column: int
    row: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RasterGrid:
    """Square pixels of `pixel_m` grid metres in a projected CRS; `left_m`, `top_m` is the corner of tile 0, 0.

    `zoom` is that of the WebMercatorQuad whose tiles these are, None for any other grid.
    """

    crs: str
    pixel_m: float
    left_m: float = 0.0
    top_m: float = 0.0
    zoom: int | None = None

    @property
    def tile_m(self) -> float:
        """A tile's side in grid metres."""
        return TILE_PX * self.pixel_m

    def corner_m(self, tile: Tile) -> tuple[float, float]:
        """Easting and northing of a tile's north-western corner."""
        return self.left_m + tile.column * self.tile_m, self.top_m - tile.row * self.tile_m

    def bounds_m(self, tiles: "TileBox") -> tuple[float, float, float, float]:
        """West, south, east and north of a box of tiles in grid metres."""
        west, north = self.corner_m(Tile(tiles.column, tiles.row))
        return west, north - tiles.rows * self.tile_m, west + tiles.columns * self.tile_m, north


@dataclass(frozen=True, slots=True, kw_only=True)
class TileBox:
    """A box of tiles: the north-western one and how many there are east and south."""

    column: int
    row: int
    columns: int
    rows: int

    def holds(self, tile: Tile) -> bool:
        """Whether a tile is one of the box."""
        return 0 <= tile.column - self.column < self.columns and 0 <= tile.row - self.row < self.rows


def box_of_cells(west: int, north: int, east: int, south: int) -> TileBox:
    """The tiles that hold the cells from one corner to another, both included."""
    column, row = west >> TILE_BITS, north >> TILE_BITS
    return TileBox(
        column=column, row=row, columns=(east >> TILE_BITS) - column + 1, rows=(south >> TILE_BITS) - row + 1
    )


def tiles_of(box: TileBox) -> list[list[Tile]]:
    """The tiles of a box, row by row."""
    columns = range(box.column, box.column + box.columns)
    return [[Tile(column, row) for column in columns] for row in range(box.row, box.row + box.rows)]


def box_of(tiles: Collection[Tile]) -> TileBox:
    """The smallest box that holds the tiles, one at least."""
    columns, rows = [tile.column for tile in tiles], [tile.row for tile in tiles]
    first, top = min(columns), min(rows)
    return TileBox(column=first, row=top, columns=max(columns) - first + 1, rows=max(rows) - top + 1)


def projected_grid(crs: str, *, resolution_m: float) -> RasterGrid:
    """The grid of a projected CRS whose pixels' edges are whole multiples of the resolution.

    Raises FrameRefused for a CRS that is unknown, InputError for one that has degrees, or a resolution out of bounds.
    """
    if not RESOLUTION_LEAST_M <= resolution_m <= RESOLUTION_MOST_M:
        raise InputError(f"resolution {resolution_m:g} m: {RESOLUTION_LEAST_M:g} to {RESOLUTION_MOST_M:g} m are taken")
    if crs_unit(crs) != "m":
        raise InputError(f"CRS {crs!r} is in degrees: a raster with pixels in metres needs a projected one")
    return RasterGrid(crs=crs, pixel_m=resolution_m)


def web_mercator_grid(position: Wgs84Position, *, resolution_m: float) -> RasterGrid:
    """The tiles of WebMercatorQuad at the least zoom whose pixels at this position are as fine as the resolution.

    Raises InputError where that is none of the zooms to 24.
    """
    metre_px = float(tile_size_m(np.array([position.lat_deg]), 0)[0]) / TILE_PX
    zoom = max(0, math.ceil(math.log2(metre_px / resolution_m)))
    if zoom > ZOOM_MOST:
        raise InputError(f"resolution {resolution_m:g} m would be zoom {zoom}: {ZOOM_MOST} at most")
    return web_mercator_zoom(zoom)


def web_mercator_zoom(zoom: int) -> RasterGrid:
    """The tiles of WebMercatorQuad at a zoom (OGC 17-083r4, annex D.1)."""
    half_m = math.pi * EARTH_RADIUS_M
    return RasterGrid(
        crs=WEB_MERCATOR, pixel_m=2.0 * half_m / (TILE_PX << zoom), left_m=-half_m, top_m=half_m, zoom=zoom
    )
