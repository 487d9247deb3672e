"""An ortho layer and an aerial image laid over each other, tile by tile."""

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint_tiles.core.consensus import contradicted
from trigpoint_tiles.core.registration import REACH_M, Registration, registered, unknown
from trigpoint_tiles.core.rendering import BANDS, HEIGHT_ABOVE_M, REFLECTIVITY
from trigpoint_tiles.geotiff import MAP_VERSION, RasterFile, RasterPlace

Floats = NDArray[np.float64]

TILE_M = 50.0  # a tile's side: large enough for edges in every direction, small enough for a stitched image's seams
PIXEL_LEAST_M, PIXEL_MOST_M = 0.2, 0.5  # finer shows the rows a lidar scans in, coarser hides kerbs and markings
MEAN_FROM = 1.5  # pixels in one a side, from which their mean is taken
CONTRADICTS = "half of the tiles around it say otherwise"
COVERED_LEAST = 0.1  # of a tile, by both


@dataclass(frozen=True, slots=True, kw_only=True)
class TileRegistration:
    """A tile's registration, and its middle in the CRS of the ortho layer, easting and northing in m, and its size:
    `width_m` from west to east, `height_m` from south to north."""

    easting_m: float
    northing_m: float
    width_m: float
    height_m: float
    registration: Registration

    def holds(self, easting_m: Floats, northing_m: Floats) -> NDArray[np.bool_]:
        """Which places (n,) lie in it, its western and southern edge included."""
        right_m, up_m = (
            easting_m - self.easting_m + 0.5 * self.width_m,
            northing_m - self.northing_m + 0.5 * self.height_m,
        )
        return np.asarray((right_m >= 0.0) & (right_m < self.width_m) & (up_m >= 0.0) & (up_m < self.height_m))


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageRegistration:
    """Every tile both cover, of a layer in `crs` of `map_version` (None where the layer does not say).

    A shift is where the image shows the ground less where the layer has it, east and north.
    """

    crs: str
    map_version: int | None
    pixel_m: float
    tiles: tuple[TileRegistration, ...]

    @property
    def accepted(self) -> tuple[TileRegistration, ...]:
        """The tiles that tell."""
        return tuple(tile for tile in self.tiles if not tile.registration.refused)

    def joined(self) -> tuple[Floats, Floats]:
        """The shift (2,) of all tiles that tell, each by its information, and its covariance (2, 2); NaN of none."""
        told = [tile.registration for tile in self.accepted]
        if not told:
            return np.full(2, np.nan), np.full((2, 2), np.nan)
        weights = [np.linalg.inv(one.covariance_m2) for one in told]
        covariance_m2 = np.linalg.inv(np.sum(weights, axis=0))
        pulled = np.sum([weight @ one.shift_m for weight, one in zip(weights, told, strict=True)], axis=0)
        return covariance_m2 @ pulled, covariance_m2


def register_image(ortho: Path, image: Path, *, reach_m: float = REACH_M) -> ImageRegistration:
    """An image's shift against an ortho layer of `trigpoint ortho render`, on the coarser one's pixels, by up to
    `reach_m` either way.

    Raises InputError for a file that is no raster, has no CRS or not these bands, and where they do not overlap.
    """
    with closing(RasterFile(ortho)) as layer, closing(RasterFile(image)) as picture:
        reflectivity, height = _band(layer, BANDS[REFLECTIVITY].name), _band(layer, BANDS[HEIGHT_ABOVE_M].name)
        whole = layer.place
        pixel_m = whole.pixel_m * _pixels_in_one(whole.pixel_m, picture.ground_pixel_m(whole))
        tiles = []
        for place in _places(whole.within(picture.bounds_on(whole)), pixel_m):
            around, margin = place.grown(reach_m)
            shown = picture.read_on(around, picture.colours, mean=pixel_m > MEAN_FROM * picture.ground_pixel_m(whole))
            seen = layer.read_on(around, (reflectivity, height), mean=pixel_m > MEAN_FROM * whole.pixel_m)
            inside = slice(margin, -margin or None)
            if min(np.isfinite(one[0, inside, inside]).mean() for one in (seen, shown)) >= COVERED_LEAST:
                tiles.append(_registered(place, seen, shown, reach_m))
        crs, version = layer.crs, layer.tag(MAP_VERSION)
    if not tiles:
        raise InputError(f"{image} and {ortho} have no tile of {TILE_M:g} m that both cover to {COVERED_LEAST:.0%}")
    return ImageRegistration(
        crs=crs,
        map_version=None if version is None else int(version),
        pixel_m=pixel_m,
        tiles=_agreeing(tiles),
    )


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
    columns, rows = shared.columns * shared.pixel_m / pixel_m, shared.rows * shared.pixel_m / pixel_m
    across, down = (max(1, round(count * pixel_m / TILE_M)) for count in (columns, rows))
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


def _registered(place: RasterPlace, seen: Floats, shown: Floats, reach_m: float) -> TileRegistration:
    try:
        found = registered([seen[0], seen[1]], seen[1], list(shown), pixel_m=place.pixel_m, reach_m=reach_m)
    except InputError as error:
        found = unknown(str(error))
    return TileRegistration(
        easting_m=place.left_m + 0.5 * place.columns * place.pixel_m,
        northing_m=place.top_m - 0.5 * place.rows * place.pixel_m,
        width_m=place.columns * place.pixel_m,
        height_m=place.rows * place.pixel_m,
        registration=found,
    )


def _agreeing(tiles: Sequence[TileRegistration]) -> tuple[TileRegistration, ...]:
    """The tiles, those refused too that contradict their neighbours."""
    told = [number for number, tile in enumerate(tiles) if not tile.registration.refused]
    if not told:
        return tuple(tiles)
    against = contradicted(
        np.array([[tiles[number].easting_m, tiles[number].northing_m] for number in told]),
        np.array([tiles[number].registration.shift_m for number in told]),
        np.array([tiles[number].registration.covariance_m2 for number in told]),
    )
    refused = {number for number, wrong in zip(told, against, strict=True) if wrong}
    return tuple(_refused(tile) if number in refused else tile for number, tile in enumerate(tiles))


def _refused(tile: TileRegistration) -> TileRegistration:
    return replace(tile, registration=replace(tile.registration, refused=CONTRADICTS))
