"""An ortho layer and an aerial image laid over each other, tile by tile."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.logs.readings import Progress, in_silence
from trigpoint_tiles.core.image_tiles import ImageRegistration, TileRegistration, agreeing
from trigpoint_tiles.core.registration import REACH_M, registered, unknown
from trigpoint_tiles.core.rendering import BANDS, HEIGHT_ABOVE_M, REFLECTIVITY
from trigpoint_tiles.geotiff import COORDINATE_EPOCH, MAP_VERSION, RasterFile, RasterPlace

Floats = NDArray[np.float64]

TILE_M = 50.0  # a tile's side: large enough for edges in every direction, small enough for a stitched image's seams
PIXEL_LEAST_M, PIXEL_MOST_M = 0.2, 0.5  # finer shows the rows a lidar scans in, coarser hides kerbs and markings
MEAN_FROM = 1.5  # pixels in one a side, from which their mean is taken
COVERED_LEAST = 0.1  # of a tile, by both


def register_image(
    ortho: Path, image: Path, *, reach_m: float = REACH_M, progress: Progress = in_silence
) -> ImageRegistration:
    """An image's shift against an ortho layer of `trigpoint ortho render`, on the coarser one's pixels, by up to
    `reach_m` either way; `progress` is told of tiles.

    Raises InputError for a file that is no raster, has no CRS or not these bands, and where they do not overlap.
    """
    with closing(RasterFile(ortho)) as layer, closing(RasterFile(image)) as picture:
        reflectivity, height = _band(layer, BANDS[REFLECTIVITY].name), _band(layer, BANDS[HEIGHT_ABOVE_M].name)
        whole = layer.place
        pixel_m = whole.pixel_m * _pixels_in_one(whole.pixel_m, picture.ground_pixel_m(whole))
        tiles, places = [], list(_places(whole.within(picture.bounds_on(whole)), pixel_m))
        for number, place in enumerate(places, start=1):
            around, margin = place.grown(reach_m)
            shown = picture.read_on(around, picture.colours, mean=pixel_m > MEAN_FROM * picture.ground_pixel_m(whole))
            seen = layer.read_on(around, (reflectivity, height), mean=pixel_m > MEAN_FROM * whole.pixel_m)
            inside = slice(margin, -margin or None)
            if min(np.isfinite(one[0, inside, inside]).mean() for one in (seen, shown)) >= COVERED_LEAST:
                tiles.append(_registered(place, seen, shown, reach_m))
            progress(number, len(places))
        crs, version, epoch = layer.crs, layer.tag(MAP_VERSION), layer.tag(COORDINATE_EPOCH)
    if not tiles:
        raise InputError(f"{image} and {ortho} have no tile of {TILE_M:g} m that both cover to {COVERED_LEAST:.0%}")
    return ImageRegistration(
        crs=crs,
        map_version=None if version is None else int(version),
        pixel_m=pixel_m,
        tiles=agreeing(tiles),
        coordinate_epoch=None if epoch is None else float(epoch),
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
