"""Ground that looks like nothing but itself: rectangles of any size and direction, for a lidar and for a camera."""

from functools import cache
from pathlib import Path

import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio.transform import from_origin

from scanned_drives.examples import FRAME, REACH_M

Floats = NDArray[np.float64]

PATCHES, LOW_M, HIGH_M = 160, np.array([50.0, 150.0]), np.array([200.0, 290.0])  # where they lie in the map
PIXEL_M = 0.2


@cache
def _patches() -> tuple[Floats, Floats]:
    random = np.random.default_rng(3)
    middle_m = random.uniform(LOW_M, HIGH_M, (PATCHES, 2))
    turn = random.uniform(0.0, np.pi, (PATCHES, 1))
    return np.column_stack([middle_m, turn, random.uniform(1.0, 6.0, (PATCHES, 2))]), random.uniform(20, 90, PATCHES)


def brightness(point_m: Floats) -> Floats:
    """How bright the ground is at map positions (n, 2)."""
    found = np.full(len(point_m), 50.0)
    for (x_m, y_m, turn, half_m, wide_m), bright in zip(*_patches(), strict=True):
        off_m = point_m - (x_m, y_m)
        along_m = off_m @ [np.cos(turn), np.sin(turn)]
        across_m = off_m @ [-np.sin(turn), np.cos(turn)]
        found[(np.abs(along_m) < half_m) & (np.abs(across_m) < wide_m)] = bright
    return found


def patched_ground(around_m: Floats, random: np.random.Generator) -> tuple[Floats, Floats]:
    """Points (n, 3) on it around places (n, 2), and how bright it is there."""
    point_m = around_m + random.uniform(-REACH_M, REACH_M, around_m.shape)
    return np.column_stack([point_m, np.zeros(len(point_m))]), brightness(point_m)


def write_aerial_image(path: Path, *, shift_m: tuple[float, float]) -> None:
    """A picture of it, off by so much to the east and north."""
    columns, rows = np.round((HIGH_M - LOW_M) / PIXEL_M).astype(int).tolist()
    x_m = LOW_M[0] + (np.arange(columns) + 0.5) * PIXEL_M - shift_m[0]
    y_m = HIGH_M[1] - (np.arange(rows) + 0.5) * PIXEL_M - shift_m[1]
    point_m = np.stack(np.meshgrid(x_m, y_m), axis=-1).reshape(-1, 2)
    west_m, north_m = FRAME.origin_easting_m + LOW_M[0], FRAME.origin_northing_m + HIGH_M[1]
    placed = {"crs": FRAME.crs, "transform": from_origin(west_m, north_m, PIXEL_M, PIXEL_M)}
    shape = {"width": columns, "height": rows, "count": 1, "dtype": "uint8"}
    with rasterio.open(path, "w", driver="GTiff", **shape, **placed) as raster:
        raster.write(brightness(point_m).reshape(1, rows, columns).astype(np.uint8))
