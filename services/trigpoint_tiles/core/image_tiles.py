"""What an image's tiles say of where it lies beside an ortho layer, each for itself and all together."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from trigpoint_tiles.core.consensus import contradicted
from trigpoint_tiles.core.registration import Registration

Floats = NDArray[np.float64]

CONTRADICTS = "half of the tiles around it say otherwise"


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

    A shift is where the image shows the ground less where the layer has it, east and north. `coordinate_epoch` is the
    layer's, a decimal year.
    """

    crs: str
    map_version: int | None
    pixel_m: float
    tiles: tuple[TileRegistration, ...]
    coordinate_epoch: float | None = None

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


def agreeing(tiles: Sequence[TileRegistration]) -> tuple[TileRegistration, ...]:
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
