"""Tiles rendered from drives' parts, a few at a time by one worker."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from trigpoint.errors import InputError
from trigpoint.geodesy.web_tiles import WebTile, tile_edges_deg, tile_size_m
from trigpoint_tiles.core.balance import Brightness, brightness
from trigpoint_tiles.core.cells import Cells
from trigpoint_tiles.core.grid import TILE_PX, RasterGrid, Tile
from trigpoint_tiles.core.part_form import bands_bytes, bands_from
from trigpoint_tiles.core.rendering import Bands, rendered
from trigpoint_tiles.part_files import DriveParts

Item = TypeVar("Item")

TILES_TOGETHER = 8  # by one worker: what its death costs


@dataclass(frozen=True, slots=True)
class SeenTile:
    """A tile, and the names and parts of the drives that saw it, by name."""

    tile: Tile
    drives: tuple[tuple[str, Path], ...]

    def cells(self) -> Iterator[tuple[str, Cells]]:
        """Each drive's name and cells, one in memory at a time. Raises InputError for damaged parts."""
        for name, folder in self.drives:
            yield name, DriveParts(folder).cells(self.tile)


def together(tiles: Sequence[Item]) -> list[tuple[Item, ...]]:
    """Tiles as workers get them."""
    return [tuple(tiles[at : at + TILES_TOGETHER]) for at in range(0, len(tiles), TILES_TOGETHER)]


def brightness_of(tiles: tuple[SeenTile, ...]) -> dict[Tile, Brightness]:
    """How bright the drives saw the tiles. Raises InputError for damaged parts."""
    return {one.tile: brightness(one.cells()) for one in tiles}


@dataclass(frozen=True, slots=True)
class BandsFolder:
    """The tiles' bands on one grid, `<column>_<row>.bands` each."""

    folder: Path
    grid: RasterGrid

    def path(self, tile: Tile) -> Path:
        """Where a tile stands."""
        return self.folder / f"{tile.column}_{tile.row}.bands"

    def read(self, tile: Tile) -> Bands:
        """A rendered tile's bands (5, 256, 256). Raises InputError for a damaged file."""
        path = self.path(tile)
        try:
            return bands_from(path.read_bytes())
        except InputError as error:
            raise InputError(f"{path}: {error}; remove {self.folder.parent} to make it again") from error

    def write(self, gains: Mapping[str, float], tiles: tuple[SeenTile, ...]) -> None:
        """Tiles rendered with the drives' gains. Raises InputError for damaged parts."""
        for one in tiles:
            pixel_m = _ground_pixel_m(self.grid, one.tile)
            chosen = [gains[name] for name, _ in one.drives]
            bands = rendered((cells for _, cells in one.cells()), chosen, pixel_area_m2=pixel_m**2)
            self.path(one.tile).write_bytes(bands_bytes(bands))


def _ground_pixel_m(grid: RasterGrid, tile: Tile) -> float:
    """The side of a tile's pixels on the ground; a projected CRS is taken as true to scale."""
    if grid.zoom is None:
        return grid.pixel_m
    _, south, _, north = tile_edges_deg(WebTile(grid.zoom, tile.column, tile.row))
    return float(tile_size_m(np.array([0.5 * (south + north)]), grid.zoom)[0]) / TILE_PX
