"""How sharp a map of registered points is, without any truth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Floats = NDArray[np.float64]

RADIUS_M = 0.3
NEIGHBOURS_MIN = 12
PLANARITY_MAX = 0.1  # the smallest variance by the middle one: flatter is a plane
EXTENT_MIN_M2 = 0.004  # of a plane's middle variance: a line along one ring is no plane
FLOOR_M2 = 2.5e-5  # 5 mm: what is flatter than any sensor measures says nothing of sharpness
QUERY_ROWS = 20_000  # at once, which bounds memory


@dataclass(frozen=True, slots=True, kw_only=True)
class Sharpness:
    """`entropy`: mean map entropy in nats (lower is sharper); `thickness_m`: the median plane's standard deviation
    across, over `planes` of the `points` that had neighbours enough."""

    entropy: float
    thickness_m: float
    points: int
    planes: int


def sharpness_of(point_m: Floats, query_m: Floats) -> Sharpness:
    """The sharpness of a map (n, 3) at some of its points (m, 3); NaN where none has neighbours enough.

    Mean map entropy (Droeschel and Behnke 2014; Razlaw et al. 2015): the mean over points of 1/2 ln |2 pi e C|, C the
    covariance of the neighbours within 0.3 m. Plane thickness: the square root of C's smallest eigenvalue where
    the neighbours lie flat.
    """
    tree = cKDTree(point_m)
    covariances = [
        _covariances(point_m, tree, query_m[begin : begin + QUERY_ROWS]) for begin in range(0, len(query_m), QUERY_ROWS)
    ]
    values = np.linalg.eigvalsh(np.concatenate([*covariances, np.zeros((0, 3, 3))]))
    values = np.maximum(values, FLOOR_M2)
    flat = (values[:, 0] <= PLANARITY_MAX * values[:, 1]) & (values[:, 1] >= EXTENT_MIN_M2)
    entropy = 0.5 * (3.0 * np.log(2.0 * np.pi * np.e) + np.log(values).sum(axis=1))
    return Sharpness(
        entropy=float(entropy.mean()) if len(values) else float("nan"),
        thickness_m=float(np.sqrt(np.median(values[flat, 0]))) if flat.any() else float("nan"),
        points=len(values),
        planes=int(flat.sum()),
    )


def _covariances(point_m: Floats, tree: cKDTree, query_m: Floats) -> Floats:
    near = tree.query_ball_point(query_m, RADIUS_M)
    chosen = [point_m[rows] for rows in near if len(rows) >= NEIGHBOURS_MIN]
    return np.array([np.cov(rows.T) for rows in chosen]).reshape(-1, 3, 3)
