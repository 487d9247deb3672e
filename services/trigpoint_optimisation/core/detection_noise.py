"""How noisy a drive's landmark detections are, told by what they leave over against the solved landmarks."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.geodesy.poses import wrap_angles_rad
from trigpoint_optimisation.core.robust_scale import robust_sigma
from trigpoint_optimisation.settings import DetectionSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

RANGE_LIMITS_M = (0.02, 0.5)
BEARING_LIMITS_RAD = (0.001, 0.05)
COMMON_LIMITS_M = (0.01, 0.5)
MEDIAN_CHI_SQUARE_2 = 1.3863  # median of chi-square with two degrees of freedom, per unit variance
MIN_DETECTIONS = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectionNoise:
    """1-sigma of one detection's range and bearing, and of the error that all detections of a landmark from one
    keyframe share (timing, tilt, which side is seen), per axis."""

    range_sigma_m: float
    bearing_sigma_rad: float
    common_sigma_m: float


def nominal_noise(settings: DetectionSettings) -> DetectionNoise:
    """The noise to begin with."""
    return DetectionNoise(
        range_sigma_m=settings.range_sigma_m,
        bearing_sigma_rad=settings.bearing_sigma_rad,
        common_sigma_m=settings.common_sigma_m,
    )


def _clipped_mad(values: Floats, limits: tuple[float, float]) -> float:
    return float(np.clip(robust_sigma(values), *limits))


def measured_noise(
    detected_m: Floats, expected_m: Floats, sensor_m: Floats, group: Ints, nominal: DetectionNoise
) -> DetectionNoise:
    """The noise that detections (n, 2) show against their landmarks (n, 2), all in their keyframes' frames.

    sensor_m (n, 2): where the sensor was; group (n,): the sighting each detection is part of. Medians throughout, so
    that wrong associations do not count.
    """
    if len(detected_m) < MIN_DETECTIONS:
        return nominal
    seen, meant = detected_m - sensor_m, expected_m - sensor_m
    range_error = np.hypot(*seen.T) - np.hypot(*meant.T)
    bearing_error = wrap_angles_rad(np.arctan2(seen[:, 1], seen[:, 0]) - np.arctan2(meant[:, 1], meant[:, 0]))
    range_sigma_m = _clipped_mad(range_error, RANGE_LIMITS_M)
    bearing_sigma_rad = _clipped_mad(bearing_error, BEARING_LIMITS_RAD)
    across_m = bearing_sigma_rad * np.hypot(*meant.T)
    return DetectionNoise(
        range_sigma_m=range_sigma_m,
        bearing_sigma_rad=bearing_sigma_rad,
        common_sigma_m=_common_sigma_m(detected_m - expected_m, 0.5 * (range_sigma_m**2 + across_m**2), group),
    )


def _common_sigma_m(error_m: Floats, variance_m2: Floats, group: Ints) -> float:
    """What the sightings' mean errors have beyond the mean of independent detections."""
    _, number = np.unique(group, return_inverse=True)
    count = np.bincount(number)
    mean = np.column_stack([np.bincount(number, weights=error_m[:, axis]) for axis in (0, 1)]) / count[:, None]
    white = np.bincount(number, weights=variance_m2) / count**2
    excess = np.median((mean**2).sum(axis=1)) / MEDIAN_CHI_SQUARE_2 - np.median(white)
    return float(np.clip(np.sqrt(max(excess, 0.0)), *COMMON_LIMITS_M))
