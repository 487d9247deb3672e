"""An ortho layer and an aerial image laid over each other, tile by tile."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint_tiles.core.registration import Registration, registered, side_least_px, unknown
from trigpoint_tiles.core.rendering import BANDS, HEIGHT_ABOVE_M, REFLECTIVITY
from trigpoint_tiles.geotiff import RasterFile, RasterPlace

Floats = NDArray[np.float64]

TILE_M = 50.0  # a tile's side: large enough for edges in every direction, small enough for a stitched image's seams
PIXEL_LEAST_M, PIXEL_MOST_M = 0.1, 0.5  # finer tells nothing more, coarser hides kerbs and markings
MEAN_FROM = 1.5  # pixels in one a side, from which their mean is taken
COVERED_LEAST = 0.1  # of a tile, by both


@dataclass(frozen=True, slots=True, kw_only=True)
class TileRegistration:
    """A tile's registration, and its middle in the CRS of the ortho layer, easting and northing in m."""

    easting_m: float
    northing_m: float
    registration: Registration


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageRegistration:
    """Every tile both cover. `shift_m` (2,), east and north, where the image shows the ground less where the layer has
    it, by all tiles that are not refused, weighted; covariance_m2 (2, 2); NaN where all are refused."""

    pixel_m: float
    tiles: tuple[TileRegistration, ...]
    shift_m: Floats
    covariance_m2: Floats

    @property
    def accepted(self) -> tuple[TileRegistration, ...]:
        """The tiles that tell."""
        return tuple(tile for tile in self.tiles if not tile.registration.refused)


def register_image(ortho: Path, image: Path) -> ImageRegistration:
    """An image's shift against an ortho layer of `trigpoint ortho render`, on the coarser one's pixels.

    Raises InputError for a file that is no raster, has no CRS or not these bands, and where they do not overlap.
    """
    with closing(RasterFile(ortho)) as layer, closing(RasterFile(image)) as picture:
        reflectivity, height = _band(layer, BANDS[REFLECTIVITY].name), _band(layer, BANDS[HEIGHT_ABOVE_M].name)
        whole = layer.place
        pixel_m = whole.pixel_m * _pixels_in_one(whole.pixel_m, picture.ground_pixel_m(whole))
        tiles = []
        for place in _places(whole.within(picture.bounds_on(whole)), pixel_m):
            shown = picture.read_on(place, picture.colours, mean=pixel_m > MEAN_FROM * picture.ground_pixel_m(whole))
            seen = layer.read_on(place, (reflectivity, height), mean=pixel_m > MEAN_FROM * whole.pixel_m)
            if min(np.isfinite(seen[0]).mean(), np.isfinite(shown[0]).mean()) >= COVERED_LEAST:
                tiles.append(_registered(place, seen, shown))
    if not tiles:
        raise InputError(f"{image} and {ortho} have no tile of {TILE_M:g} m that both cover to {COVERED_LEAST:.0%}")
    return _joined(pixel_m, tuple(tiles))


def _pixels_in_one(layer_m: float, image_m: float) -> int:
    """How many of the layer's pixels a side make one to register on: about as coarse as the image's."""
    wanted_m = min(max(layer_m, image_m, PIXEL_LEAST_M), PIXEL_MOST_M)
    return max(1, round(wanted_m / layer_m))


def _band(layer: RasterFile, name: str) -> int:
    if name not in layer.names:
        there = ", ".join(filter(None, layer.names)) or "bands without names"
        raise InputError(f"{layer.path}: no band {name!r}, but {there}: an ortho layer of `trigpoint ortho render` has")
    return layer.names.index(name) + 1


def _places(shared: RasterPlace, pixel_m: float) -> Iterator[RasterPlace]:
    """The ground both cover, cut into tiles of about the same size."""
    side_px = max(TILE_M / pixel_m, side_least_px(pixel_m))
    columns, rows = shared.columns * shared.pixel_m / pixel_m, shared.rows * shared.pixel_m / pixel_m
    across, down = max(1, round(columns / side_px)), max(1, round(rows / side_px))
    for number in range(across * down):
        left, top = number % across * int(columns / across), number // across * int(rows / down)
        yield RasterPlace(
            crs=shared.crs,
            left_m=shared.left_m + left * pixel_m,
            top_m=shared.top_m - top * pixel_m,
            pixel_m=pixel_m,
            columns=int(columns / across),
            rows=int(rows / down),
        )


def _registered(place: RasterPlace, seen: Floats, shown: Floats) -> TileRegistration:
    try:
        found = registered([seen[0], seen[1]], seen[1], list(shown), pixel_m=place.pixel_m)
    except InputError as error:
        found = unknown(str(error))
    return TileRegistration(
        easting_m=place.left_m + 0.5 * place.columns * place.pixel_m,
        northing_m=place.top_m - 0.5 * place.rows * place.pixel_m,
        registration=found,
    )


def _joined(pixel_m: float, tiles: tuple[TileRegistration, ...]) -> ImageRegistration:
    """All tiles' shifts in one, each by its information."""
    told = [tile.registration for tile in tiles if not tile.registration.refused]
    if not told:
        nothing = unknown("")
        return ImageRegistration(
            pixel_m=pixel_m, tiles=tiles, shift_m=nothing.shift_m, covariance_m2=nothing.covariance_m2
        )
    weights = [np.linalg.inv(one.covariance_m2) for one in told]
    covariance_m2 = np.linalg.inv(np.sum(weights, axis=0))
    pulled = np.sum([weight @ one.shift_m for weight, one in zip(weights, told, strict=True)], axis=0)
    return ImageRegistration(pixel_m=pixel_m, tiles=tiles, shift_m=covariance_m2 @ pulled, covariance_m2=covariance_m2)
