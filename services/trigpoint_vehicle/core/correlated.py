"""Noise correlated in time."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Floats = NDArray[np.float64]


def gauss_markov(
    count: int, columns: int, *, sigma: float, step_s: float, time_s: float, rng: np.random.Generator
) -> Floats:
    """A first-order Gauss-Markov process (count, columns), stationary with 1-sigma `sigma` (Gelb 1974, eq. 2.2-69)."""
    keep = math.exp(-step_s / time_s)
    drive = rng.normal(0.0, sigma * math.sqrt(1.0 - keep**2), (count, columns))
    drive[:1] = rng.normal(0.0, sigma, (1, columns))
    process: Floats = np.asarray(lfilter([1.0], [1.0, -keep], drive, axis=0), dtype=np.float64)
    return process
