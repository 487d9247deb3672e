"""Tiles of 50 m side by side on the grid of Sydney, with the shifts they are given."""

import numpy as np

from trigpoint_tiles.core.image_tiles import ImageRegistration, TileRegistration
from trigpoint_tiles.core.registration import Registration

CRS = "EPSG:32756"
SIDE_M, EAST_M, NORTH_M = 50.0, 332_000.0, 6_248_000.0


def tile(number: int, shift_m: tuple[float, float], *, sigma_m: float = 0.05, refused: str = "") -> TileRegistration:
    """The tile so many to the east."""
    told = Registration(
        shift_m=np.array(shift_m),
        covariance_m2=np.diag([sigma_m**2, sigma_m**2]),
        lean=np.zeros(2),
        confidence=0.99,
        refused=refused,
    )
    return TileRegistration(
        easting_m=EAST_M + number * SIDE_M, northing_m=NORTH_M, width_m=SIDE_M, height_m=SIDE_M, registration=told
    )


def registered(*tiles: TileRegistration) -> ImageRegistration:
    """An image of these tiles beside the layer of map version 3."""
    return ImageRegistration(crs=CRS, map_version=3, pixel_m=0.2, tiles=tiles, coordinate_epoch=2023.87)
