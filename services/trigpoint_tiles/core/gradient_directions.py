"""Which way a picture's edges run, whatever made it: so that a lidar's picture and a camera's can be laid over another.

An edge counts alike whether it goes from dark to bright or back, which differs between reflectivity, height and colour.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

COVERAGE_LEAST = 0.3  # share of a pixel's neighbourhood that was seen; below it an edge is the edge of what was seen


def smoothed(layer: Floats, *, sigma_px: float) -> tuple[Floats, NDArray[np.bool_]]:
    """A layer (h, w), NaN where nothing was seen, smoothed over what was seen, and where that is enough to go by.

    Normalised convolution (Knutsson and Westin 1993) with a Gaussian.
    """
    seen = np.isfinite(layer)
    weight = ndimage.gaussian_filter(seen.astype(np.float64), sigma_px)
    total = ndimage.gaussian_filter(np.where(seen, layer, 0.0), sigma_px)
    return total / np.maximum(weight, np.finfo(np.float64).tiny), weight > COVERAGE_LEAST


def edge_directions(layers: Sequence[Floats], *, sigma_px: float) -> Complexes:
    """The layers' (h, w) edges as one complex field (h, w): twice an edge's direction as angle, its clearness, 0 to 1,
    as length.

    Normalised gradients (Haber and Modersitzki 2006) with doubled angle: the real part of one field times the other's
    conjugate is highest where edges are parallel, of whichever sign. As there, a layer's mean gradient is its noise.
    """
    field = np.zeros(layers[0].shape, dtype=np.complex128)
    for layer in layers:
        field += _directions(layer, sigma_px=sigma_px)
    return field / len(layers)


def _directions(layer: Floats, *, sigma_px: float) -> Complexes:
    level, seen = smoothed(layer, sigma_px=sigma_px)
    down, right = np.gradient(level)
    inside = ndimage.binary_erosion(seen)
    squared = (right + 1j * down) ** 2
    clear = np.abs(squared)
    noise = float(np.sqrt(clear[inside]).mean()) ** 2 if inside.any() else 0.0
    unit = np.where(inside & (clear > 0.0), squared / np.maximum(clear + noise, np.finfo(np.float64).tiny), 0.0)
    return np.asarray(unit, dtype=np.complex128)
