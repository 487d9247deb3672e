"""Which points of a scan a lidar measured, and which stand for a pulse that did not come back."""

import numpy as np
from numpy.typing import NDArray


def returned_points(point_m: NDArray[np.float32]) -> NDArray[np.float32]:
    """The points (n, 3), NaN where all three coordinates are 0: so drivers write a pulse that did not come back."""
    lost = np.asarray(~point_m.any(axis=1))
    return np.where(lost[:, np.newaxis], np.float32(np.nan), point_m) if lost.any() else point_m
