"""Covariances kept symmetric positive definite, and ellipses of them."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def floored_covariance(covariance: Floats, *, floor: float) -> Floats:
    """The nearest symmetric matrix (n, n) whose eigenvalues are all at least `floor` (Higham 1988)."""
    symmetric = 0.5 * (covariance + covariance.T)
    values, vectors = np.linalg.eigh(symmetric)
    if values[0] >= floor:
        return symmetric
    rebuilt: Floats = (vectors * np.maximum(values, floor)) @ vectors.T
    return 0.5 * (rebuilt + rebuilt.T)


def ellipses_of(covariance_m2: Floats) -> Floats:
    """The 1-sigma ellipses (n, 3) of covariances (n, 2, 2) in m^2, rows and columns east, north: semi-major and
    semi-minor axis in m, heading of the longer one in rad counter-clockwise from east."""
    values, vectors = np.linalg.eigh(0.5 * (covariance_m2 + np.swapaxes(covariance_m2, -1, -2)))
    semi_m = np.sqrt(np.maximum(values, 0.0))
    heading_rad = np.arctan2(vectors[:, 1, 1], vectors[:, 0, 1])
    return np.column_stack([semi_m[:, 1], semi_m[:, 0], heading_rad])
