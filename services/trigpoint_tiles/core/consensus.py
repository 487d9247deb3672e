"""Which tiles' shifts contradict those around them: a map bends, but not by that much from one tile to the next."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

NEIGHBOUR_M = 200.0  # how far apart tiles are that can speak of each other
BEND_SIGMA_M = 0.1  # 1-sigma per axis by which shifts of neighbours differ, at any distance
BEND_PER_M = 0.005  # and what a metre between them adds: of a map of fixes alone, half a metre in a hundred
CONTRADICTION = 13.8  # chi-squared of two degrees of freedom, 0.999


def contradicted(middle_m: Floats, shift_m: Floats, covariance_m2: Floats) -> Flags:
    """Which tiles (n,) differ from half of their neighbours or more: middle_m (n, 2), shift_m (n, 2) and covariance_m2
    (n, 2, 2), east and north. A tile without neighbours contradicts none.

    Of neighbours that differ nobody knows which one is wrong until most of those around both agree with one of them.
    """
    apart_m = np.linalg.norm(middle_m[:, None] - middle_m[None, :], axis=-1)
    near = (apart_m <= NEIGHBOUR_M) & ~np.eye(len(middle_m), dtype=bool)
    differ_m = shift_m[:, None] - shift_m[None, :]
    bend_m2 = BEND_SIGMA_M**2 + (BEND_PER_M * apart_m) ** 2
    expected_m2 = covariance_m2[:, None] + covariance_m2[None, :] + bend_m2[..., None, None] * np.eye(2)
    solved = np.linalg.solve(expected_m2, differ_m[..., None])[..., 0]
    against = near & ((differ_m * solved).sum(axis=-1) > CONTRADICTION)
    return np.asarray((against.sum(axis=1) > 0) & (2 * against.sum(axis=1) >= near.sum(axis=1)))
