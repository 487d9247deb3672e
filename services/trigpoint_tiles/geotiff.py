"""Rasters as GeoTIFF: written cloud optimised from tiles, read on any grid. rasterio's one home."""

import math
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import rasterio
import rasterio.shutil
from numpy.typing import NDArray
from rasterio.enums import ColorInterp, Resampling
from rasterio.errors import NotGeoreferencedWarning, RasterioError
from rasterio.transform import Affine, from_origin
from rasterio.warp import calculate_default_transform, reproject, transform_bounds
from rasterio.windows import Window

from trigpoint.durable_files import replaced_durably
from trigpoint.errors import InputError
from trigpoint_tiles.core.grid import TILE_PX, RasterGrid, Tile, TileBox
from trigpoint_tiles.core.mosaics import finest, mosaic_vrt
from trigpoint_tiles.core.rendering import BANDS, Bands
from trigpoint_tiles.picture_files import tile_file, xyz_tiles

Floats = NDArray[np.float64]

MARGIN_PX = 4  # more than a cubic looks at
COLOURS_MOST = 3  # what follows is infrared, if not alpha
MAP_VERSION, COORDINATE_EPOCH = "MAP_VERSION", "COORDINATE_EPOCH"  # of a layer's metadata
CACHE_BYTES = 64 * 1024**2  # of GDAL's blocks
WORKING = {"driver": "GTiff", "dtype": "float32", "tiled": True, "compress": "zstd", "zstd_level": 1}
OPTIMISED = {"compress": "DEFLATE", "predictor": "YES", "blocksize": 512, "bigtiff": "IF_SAFER"}


def write_cog(
    path: Path, grid: RasterGrid, box: TileBox, tiles: Iterable[tuple[Tile, Bands]], *, tags: Mapping[str, str]
) -> None:
    """The tiles of a box as one Cloud Optimized GeoTIFF with overviews, in place of what stood there once it is whole.

    One tile is in memory at a time. Raises InputError where GDAL cannot write.
    """
    working = path.with_name(f"{path.name}.working.tif")
    try:
        with rasterio.Env(GDAL_CACHEMAX=CACHE_BYTES):
            _write_working(working, grid, box, tiles, tags)
            with replaced_durably(path) as partial:
                rasterio.shutil.copy(working, partial, driver="COG", overview_resampling="average", **OPTIMISED)
    except RasterioError as error:
        raise InputError(f"{path}: cannot be written: {error}") from error
    finally:
        working.unlink(missing_ok=True)


def _write_working(
    path: Path, grid: RasterGrid, box: TileBox, tiles: Iterable[tuple[Tile, Bands]], tags: Mapping[str, str]
) -> None:
    west, _, _, north = grid.bounds_m(box)
    size = {"width": box.columns * TILE_PX, "height": box.rows * TILE_PX, "count": len(BANDS)}
    blocks = {"blockxsize": TILE_PX, "blockysize": TILE_PX, "sparse_ok": True, "bigtiff": "IF_SAFER"}
    placed = {"crs": grid.crs, "transform": from_origin(west, north, grid.pixel_m, grid.pixel_m), "nodata": np.nan}
    with rasterio.open(path, "w", **WORKING, **size, **blocks, **placed) as raster:
        raster.update_tags(**tags)
        for number, band in enumerate(BANDS, start=1):
            raster.set_band_description(number, band.name)
            raster.set_band_unit(number, band.unit)
            raster.update_tags(number, meaning=band.meaning)
        for tile, bands in tiles:
            column, row = (tile.column - box.column) * TILE_PX, (tile.row - box.row) * TILE_PX
            raster.write(bands, window=Window(column, row, TILE_PX, TILE_PX))


def _tiles_as_one(folder: Path) -> str:
    """The finest tiles of a folder as a mosaic in GDAL's own words. Raises InputError."""
    paths = dict(xyz_tiles(folder))
    if not paths:
        raise InputError(f"{folder}: no tiles here: a folder of web tiles has {{z}}/{{x}}/{{y}}.png, .jpg or .webp")
    return mosaic_vrt({tile: tile_file(paths[tile]) for tile in finest(paths)})


@dataclass(frozen=True, slots=True, kw_only=True)
class RasterPlace:
    """Where a raster lies: CRS, the corner in the north-west, pixel side in grid metres, columns and rows."""

    crs: str
    left_m: float
    top_m: float
    pixel_m: float
    columns: int
    rows: int

    def within(self, bounds: tuple[float, float, float, float]) -> "RasterPlace":
        """The part of it inside bounds: west, south, east, north in grid metres; of no pixel where there is none."""
        west, south, east, north = bounds
        left, top = (max(round(off_m / self.pixel_m), 0) for off_m in (west - self.left_m, self.top_m - north))
        right, bottom = round((east - self.left_m) / self.pixel_m), round((self.top_m - south) / self.pixel_m)
        return RasterPlace(
            crs=self.crs,
            left_m=self.left_m + left * self.pixel_m,
            top_m=self.top_m - top * self.pixel_m,
            pixel_m=self.pixel_m,
            columns=max(min(right, self.columns) - left, 0),
            rows=max(min(bottom, self.rows) - top, 0),
        )

    def grown(self, margin_m: float) -> tuple["RasterPlace", int]:
        """With at least so many metres more to every side, and how many pixels that is."""
        margin = math.ceil(margin_m / self.pixel_m)
        grown = replace(
            self,
            left_m=self.left_m - margin * self.pixel_m,
            top_m=self.top_m + margin * self.pixel_m,
            columns=self.columns + 2 * margin,
            rows=self.rows + 2 * margin,
        )
        return grown, margin

    @property
    def bounds_m(self) -> tuple[float, float, float, float]:
        """West, south, east and north in grid metres."""
        east_m, south_m = self.left_m + self.columns * self.pixel_m, self.top_m - self.rows * self.pixel_m
        return self.left_m, south_m, east_m, self.top_m

    @property
    def transform(self) -> Affine:
        """From columns and rows to grid metres."""
        return from_origin(self.left_m, self.top_m, self.pixel_m, self.pixel_m)


class RasterFile:
    """A georeferenced raster file, or a folder of web tiles, read a part at a time on pixels of one's choice."""

    def __init__(self, path: Path) -> None:
        """A folder holds WebMercatorQuad tiles `{z}/{x}/{y}.<ending>`; those of its finest zoom are read.

        Raises InputError for a file GDAL cannot read, or one that does not say where it lies, and for a folder without
        such tiles.
        """
        self.path = path
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", NotGeoreferencedWarning)  # refused below, by name
                self._raster = rasterio.open(_tiles_as_one(path) if path.is_dir() else path)
        except RasterioError as error:
            raise InputError(f"{path}: no raster can be read here: {error}") from error
        if self._raster.crs is None or self._raster.transform.is_identity:
            missing = "CRS" if self._raster.crs is None else "georeference"
            self._raster.close()
            raise InputError(f"{path}: the image has no {missing}: nobody can say where it lies")

    def close(self) -> None:
        """The file closed."""
        self._raster.close()

    @property
    def names(self) -> tuple[str, ...]:
        """The bands' names, empty where they have none."""
        return tuple(name or "" for name in self._raster.descriptions)

    @property
    def place(self) -> RasterPlace:
        """Where it lies. Raises InputError where it is not in metres, or not north up with square pixels."""
        raster = self._raster
        turned = abs(raster.transform.b) + abs(raster.transform.d) > 0.0
        if (
            not raster.crs.is_projected
            or raster.crs.linear_units_factor[1] != 1.0
            or turned
            or raster.transform.e > 0.0
        ):
            raise InputError(f"{self.path}: {raster.crs} is not a projected CRS in metres, or the raster not north up")
        across, down = raster.res
        if abs(across - down) > 1e-6 * across:
            raise InputError(f"{self.path}: pixels of {across:g} by {down:g} m: square ones are needed")
        return RasterPlace(
            crs=raster.crs.to_wkt(),
            left_m=raster.transform.c,
            top_m=raster.transform.f,
            pixel_m=across,
            columns=raster.width,
            rows=raster.height,
        )

    @property
    def crs(self) -> str:
        """Its CRS by authority and code where it has one, else as WKT."""
        return str(self._raster.crs.to_string())

    @property
    def colours(self) -> tuple[int, ...]:
        """The numbers of its first bands that show something, from 1, three at most."""
        seen = [number for number in self._raster.indexes if self._raster.colorinterp[number - 1] != ColorInterp.alpha]
        return tuple(seen[:COLOURS_MOST])

    def tag(self, name: str) -> str | None:
        """What the file's metadata say under a name, None where they say nothing."""
        found = self._raster.tags().get(name)
        return None if found is None else str(found)

    def bounds_on(self, place: RasterPlace) -> tuple[float, float, float, float]:
        """West, south, east and north in the metres of another raster's grid. Raises InputError as `read_on` does."""
        try:
            west, south, east, north = transform_bounds(self._raster.crs, place.crs, *self._raster.bounds)
        except RasterioError as error:
            raise InputError(f"{self.path}: cannot be brought onto the other's pixels: {error}") from error
        return float(west), float(south), float(east), float(north)

    def ground_pixel_m(self, place: RasterPlace) -> float:
        """The side of a pixel, in the metres of another raster's grid. Raises InputError as `read_on` does."""
        raster = self._raster
        try:
            found, _, _ = calculate_default_transform(
                raster.crs, place.crs, raster.width, raster.height, *raster.bounds
            )
        except RasterioError as error:
            raise InputError(f"{self.path}: cannot be brought onto the other's pixels: {error}") from error
        return float(found.a)

    def read_on(self, place: RasterPlace, bands: tuple[int, ...], *, mean: bool) -> Floats:
        """Bands (n, rows, columns), numbered from 1, on another's pixels, NaN outside or where there is nothing.

        `mean` of what falls into a pixel, for pixels larger than the file's; else a cubic through its neighbours.
        Raises InputError where the two CRS have no known relation.
        """
        found = np.full((len(bands), place.rows, place.columns), np.nan)
        try:
            source, transform = self._around(place, bands)
            for at in range(len(bands)):
                reproject(
                    source[at],
                    found[at],
                    src_transform=transform,
                    src_crs=self._raster.crs,
                    src_nodata=np.nan,
                    dst_transform=place.transform,
                    dst_crs=place.crs,
                    dst_nodata=np.nan,
                    resampling=Resampling.average if mean else Resampling.cubic,
                )
        except RasterioError as error:
            raise InputError(f"{self.path}: cannot be brought onto the other's pixels: {error}") from error
        return found

    def _around(self, place: RasterPlace, bands: tuple[int, ...]) -> tuple[Floats, Affine]:
        """The file's own pixels around a place, (n, rows, columns), NaN where none of its bands has data."""
        raster = self._raster
        bounds = transform_bounds(place.crs, raster.crs, *place.bounds_m)
        near = raster.window(*bounds)
        left, top = math.floor(near.col_off) - MARGIN_PX, math.floor(near.row_off) - MARGIN_PX
        right, bottom = (math.ceil(end) + MARGIN_PX for end in (near.col_off + near.width, near.row_off + near.height))
        left, top, right, bottom = max(left, 0), max(top, 0), min(right, raster.width), min(bottom, raster.height)
        window = Window(left, top, max(right - left, 1), max(bottom - top, 1))
        pixels = raster.read(bands, window=window).astype(np.float64)
        pixels[:, raster.dataset_mask(window=window) == 0] = np.nan
        return pixels, raster.window_transform(window)
