"""The noise of detections is measured from what they leave over, and wrong associations do not count."""

import numpy as np
import pytest
from numpy.typing import NDArray

from trigpoint_optimisation.core.detection_noise import DetectionNoise, measured_noise, nominal_noise
from trigpoint_optimisation.settings import DetectionSettings

Floats = NDArray[np.float64]

NOMINAL = nominal_noise(DetectionSettings())
SIGHTINGS, EACH = 800, 6  # detections of one landmark from one keyframe


def measured(*, range_m: float, bearing_rad: float, common_m: float, wrong: float = 0.0) -> DetectionNoise:
    """The noise found in detections made with a known one; a part of them is of something else."""
    rng = np.random.default_rng(1)
    distance = np.repeat(rng.uniform(5.0, 30.0, SIGHTINGS), EACH)
    bearing = np.repeat(rng.uniform(-np.pi, np.pi, SIGHTINGS), EACH)
    expected = np.column_stack([distance * np.cos(bearing), distance * np.sin(bearing)])
    distance = distance + rng.normal(0.0, range_m, len(distance))
    bearing = bearing + rng.normal(0.0, bearing_rad, len(bearing))
    detected = np.column_stack([distance * np.cos(bearing), distance * np.sin(bearing)])
    detected += np.repeat(rng.normal(0.0, common_m, (SIGHTINGS, 2)), EACH, axis=0)
    detected[: round(wrong * len(detected))] += 1.4
    return measured_noise(detected, expected, np.zeros_like(detected), np.arange(len(detected)) // EACH, NOMINAL)


def test_range_and_bearing_noise_are_told_apart() -> None:
    found = measured(range_m=0.15, bearing_rad=0.004, common_m=0.0)
    assert found.range_sigma_m == pytest.approx(0.15, rel=0.05)  # 4800 detections, by medians: 2 %
    assert found.bearing_sigma_rad == pytest.approx(0.004, rel=0.05)


def test_what_all_detections_of_a_keyframe_share_is_found() -> None:
    found = measured(range_m=0.05, bearing_rad=0.002, common_m=0.2)
    # m: the range noise measured holds part of it too, so a tenth less than 0.2 is left for it
    assert 0.16 < found.common_sigma_m < 0.205


def test_nothing_shared_is_found_where_there_is_nothing() -> None:
    assert measured(range_m=0.15, bearing_rad=0.002, common_m=0.0).common_sigma_m < 0.05  # m, of 0.15 m white


def test_a_tenth_of_wrong_associations_does_not_count() -> None:
    found = measured(range_m=0.15, bearing_rad=0.004, common_m=0.0, wrong=0.1)
    assert found.range_sigma_m == pytest.approx(0.15, rel=0.25)  # a median's shift by a tenth of outliers


def test_impossibly_good_detections_are_not_believed_to_be_perfect() -> None:
    found = measured(range_m=0.0, bearing_rad=0.0, common_m=0.0)
    assert (found.range_sigma_m, found.bearing_sigma_rad) == (0.02, 0.001)


def test_a_few_detections_keep_the_nominal_noise() -> None:
    few = np.ones((10, 2))
    assert measured_noise(few, few, np.zeros((10, 2)), np.arange(10), NOMINAL) == NOMINAL
