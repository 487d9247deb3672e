"""How far bright spots of a picture lie from where they should be."""

from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import center_of_mass, label

Floats = NDArray[np.float64]

SHOWN = 128  # of 255: a point's grey is above it, the picture around it below


def centroid_px(picture: Floats, near_px: Floats, radius_px: float) -> Floats:
    """Column and row of the middle of the bright spot within a radius of a place, in pixels; a pixel's middle is at
    a half.

    `picture` (rows, columns), NaN where it shows nothing. Weighted by how much brighter than its darkest a pixel is.
    """
    row, column = np.indices(picture.shape) + 0.5
    inside = (np.hypot(column - near_px[0], row - near_px[1]) < radius_px) & np.isfinite(picture)
    weight = picture[inside] - picture[inside].min()
    assert weight.sum() > 0.0, f"nothing bright within {radius_px:g} pixels of {near_px}"
    return np.array([np.average(column[inside], weights=weight), np.average(row[inside], weights=weight)])


def worst_px(picture: Floats, places_px: Floats, *, radius_px: float) -> float:
    """The farthest any bright spot is from its place (n, 2: column, row), in pixels."""
    return max(float(np.hypot(*(centroid_px(picture, place, radius_px) - place))) for place in places_px)


def places_in(picture: Floats, *, count: int) -> Floats:
    """Column and row (n, 2) of the middles of the drawn points. Raises AssertionError where there are not `count`."""
    drawn, found = label(picture > SHOWN)
    assert found == count, f"{found} points are drawn, {count} should be"
    middles = np.asarray(center_of_mass(picture, drawn, range(1, found + 1)))
    return middles[:, ::-1] + 0.5


def grey_of(png: bytes) -> Floats:
    """A picture's brightness (rows, columns), 0 to 255."""
    with Image.open(BytesIO(png)) as image:
        return np.asarray(image.convert("L"), dtype=np.float64)
