"""What is said of a set of errors: always the same six numbers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorSummary:
    """Statistics of distances in metres; all but `count` are NaN where there is nothing to summarise."""

    count: int
    mean: float
    median: float
    rmse: float
    p95: float
    max: float


NO_ERRORS = ErrorSummary(
    count=0, mean=float("nan"), median=float("nan"), rmse=float("nan"), p95=float("nan"), max=float("nan")
)


def summary_of(distance_m: Floats) -> ErrorSummary:
    """The statistics of distances of any shape; NaN entries (no counterpart) are left out, not counted as 0."""
    known = distance_m[np.isfinite(distance_m)]
    if known.size == 0:
        return NO_ERRORS
    return ErrorSummary(
        count=int(known.size),
        mean=float(np.mean(known)),
        median=float(np.median(known)),
        rmse=float(np.sqrt(np.mean(known**2))),
        p95=float(np.percentile(known, 95.0)),
        max=float(np.max(known)),
    )


def distances_m(point_m: Floats, other_m: Floats) -> Floats:
    """Distances (n,) in m between points (n, 2) and (n, 2); NaN where either is."""
    away_m: Floats = np.hypot(point_m[:, 0] - other_m[:, 0], point_m[:, 1] - other_m[:, 1])
    return away_m
