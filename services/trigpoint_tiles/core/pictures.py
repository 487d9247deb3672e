"""Tiles as pictures for people: grey by reflectivity, clear where nothing was seen, and the same again from farther."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from trigpoint_tiles.core.grid import TILE_PX
from trigpoint_tiles.core.rendering import REFLECTIVITY, Bands

Picture = NDArray[np.uint8]

OPAQUE = 255


def picture(bands: Bands) -> Picture:
    """Grey and alpha (256, 256, 2) of a tile's bands; the usual ground is middle grey, whatever else the map holds."""
    value = bands[REFLECTIVITY]
    seen = np.isfinite(value)
    bright = np.where(seen, value, 0.0)
    grey = np.where(seen, np.rint(OPAQUE * bright / (bright + 1.0)), 0)
    return np.stack([grey, np.where(seen, OPAQUE, 0)], axis=-1).astype(np.uint8)


def from_farther(children: Mapping[tuple[int, int], Picture]) -> Picture:
    """The picture of a tile one zoom out from those (256, 256, 2) of its children, by column and row, 0 or 1 each."""
    whole = np.zeros((2 * TILE_PX, 2 * TILE_PX, 2), dtype=np.float64)
    for (column, row), child in children.items():
        whole[row * TILE_PX : (row + 1) * TILE_PX, column * TILE_PX : (column + 1) * TILE_PX] = child
    alpha = whole[..., 1].reshape(TILE_PX, 2, TILE_PX, 2)
    grey = whole[..., 0].reshape(TILE_PX, 2, TILE_PX, 2)
    weight = alpha.sum(axis=(1, 3))
    mean = (grey * alpha).sum(axis=(1, 3)) / np.maximum(weight, 1.0)
    return np.stack([np.rint(mean), np.rint(weight / 4.0)], axis=-1).astype(np.uint8)
