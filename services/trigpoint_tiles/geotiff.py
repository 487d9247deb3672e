"""Rasters as GeoTIFF: written cloud optimised from tiles, read on any grid. rasterio's one home."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rasterio
import rasterio.shutil
from numpy.typing import NDArray
from rasterio.enums import Resampling
from rasterio.errors import RasterioError
from rasterio.transform import Affine, from_origin
from rasterio.warp import calculate_default_transform, reproject
from rasterio.windows import Window

from trigpoint.durable_files import replaced_durably
from trigpoint.errors import InputError
from trigpoint_tiles.core.grid import TILE_PX, RasterGrid, Tile, TileBox
from trigpoint_tiles.core.rendering import BANDS, Bands

Floats = NDArray[np.float64]

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


@dataclass(frozen=True, slots=True, kw_only=True)
class RasterPlace:
    """Where a raster lies: CRS, the corner in the north-west, pixel side in grid metres, columns and rows."""

    crs: str
    left_m: float
    top_m: float
    pixel_m: float
    columns: int
    rows: int

    @property
    def transform(self) -> Affine:
        """From columns and rows to grid metres."""
        return from_origin(self.left_m, self.top_m, self.pixel_m, self.pixel_m)


class RasterFile:
    """A georeferenced raster file, read a part at a time on pixels of one's choice."""

    def __init__(self, path: Path) -> None:
        """Raises InputError for a file GDAL cannot read, or one that does not say where it lies."""
        self.path = path
        try:
            self._raster = rasterio.open(path)
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
    def band_count(self) -> int:
        """How many bands it has."""
        return int(self._raster.count)

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
        resampling = Resampling.average if mean else Resampling.cubic
        try:
            for at, band in enumerate(bands):
                reproject(
                    rasterio.band(self._raster, band),
                    found[at],
                    dst_transform=place.transform,
                    dst_crs=place.crs,
                    dst_nodata=np.nan,
                    resampling=resampling,
                )
        except RasterioError as error:
            raise InputError(f"{self.path}: cannot be brought onto the other's pixels: {error}") from error
        return found
