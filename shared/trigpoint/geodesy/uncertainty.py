"""Covariances kept symmetric positive definite, and ellipses of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Ellipse:
    """A 1-sigma ellipse: semi-axes in metres, `heading_rad` of the longer one counter-clockwise from east."""

    semi_major_m: float
    semi_minor_m: float
    heading_rad: float


def floored_covariance(covariance: Floats, *, floor: float) -> Floats:
    """The nearest symmetric matrix (n, n) whose eigenvalues are all at least `floor` (Higham 1988)."""
    symmetric = 0.5 * (covariance + covariance.T)
    values, vectors = np.linalg.eigh(symmetric)
    if values[0] >= floor:
        return symmetric
    rebuilt: Floats = (vectors * np.maximum(values, floor)) @ vectors.T
    return 0.5 * (rebuilt + rebuilt.T)


def ellipse_of(covariance_m2: Floats) -> Ellipse:
    """The 1-sigma ellipse of a covariance (2, 2) in m^2, rows and columns east, north."""
    values, vectors = np.linalg.eigh(0.5 * (covariance_m2 + covariance_m2.T))
    major = vectors[:, 1]
    semi = np.sqrt(np.maximum(values, 0.0))
    return Ellipse(float(semi[1]), float(semi[0]), float(np.arctan2(major[1], major[0])))
