"""The scale of errors among which some are wild."""

import numpy as np
from numpy.typing import NDArray

SIGMAS_PER_MAD = 1.4826  # of a normal distribution


def robust_sigma(error: NDArray[np.float64]) -> float:
    """1-sigma of errors around zero, any shape, by the median of their sizes (Rousseeuw and Croux 1993)."""
    return SIGMAS_PER_MAD * float(np.median(np.abs(error)))
