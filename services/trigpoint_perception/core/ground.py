"""The ground under a sweep: one profile a sector, walked outwards (after Himmelsbach et al. 2010, by slope)."""

import numpy as np
from numpy.typing import NDArray

from trigpoint_perception.core.compiled import compiled
from trigpoint_perception.core.sweep import Sweep
from trigpoint_perception.settings import GroundSettings

Floats = NDArray[np.float64]

SLOPE_OF_ANY = 0.2  # deeper than this below the base frame's ground is a mirrored point, and no ground
DEPTH_OF_ANY_M = 0.25
SMOOTHED_SECTORS = 2  # to either side: a profile is the median of five


def heights_above_ground(sweep: Sweep, settings: GroundSettings, *, range_max_m: float) -> Floats:
    """The height (n,) in m of each point of a sweep above the ground beneath it.

    The walk starts on the base frame's ground. A bin whose lowest point is steeper above or below the last ground than
    `slope_max` and a kerb allow holds no ground; between bins the profile is straight, beyond the last it is level.
    """
    bins = int(np.ceil(range_max_m / settings.bin_m)) + 1
    lowest = _lowest(sweep.point_m, sweep.sensor_m, settings.sectors, bins, settings.bin_m)
    profile = _profiles(lowest, settings.bin_m, settings.slope_max, settings.step_m)
    turned = [np.roll(profile, shift, axis=0) for shift in range(-SMOOTHED_SECTORS, SMOOTHED_SECTORS + 1)]
    return _heights(sweep.point_m, sweep.sensor_m, np.median(turned, axis=0), settings.bin_m)


@compiled
def _lowest(point_m: Floats, sensor_m: Floats, sectors: int, bins: int, bin_m: float) -> Floats:
    """The lowest point's height (sectors, bins), infinite where a bin holds none."""
    lowest = np.full((sectors, bins), np.inf)
    for row in range(len(point_m)):
        x = point_m[row, 0] - sensor_m[0]
        y = point_m[row, 1] - sensor_m[1]
        run = np.hypot(x, y)
        if point_m[row, 2] < -SLOPE_OF_ANY * run - DEPTH_OF_ANY_M:
            continue
        sector = int((np.arctan2(y, x) + np.pi) / (2.0 * np.pi) * sectors) % sectors
        number = min(int(run / bin_m), bins - 1)
        lowest[sector, number] = min(lowest[sector, number], point_m[row, 2])
    return lowest


@compiled
def _profiles(lowest: Floats, bin_m: float, slope_max: float, step_m: float) -> Floats:
    """Ground heights (sectors, bins) at the bins' middles."""
    sectors, bins = lowest.shape
    ground = np.zeros((sectors, bins))
    for sector in range(sectors):
        last, height = -1, 0.0
        for number in range(bins):
            steps = number - last if last >= 0 else number + 0.5
            if abs(lowest[sector, number] - height) > slope_max * steps * bin_m + step_m:
                continue
            for between in range(last + 1, number):
                share = (between - last) / (number - last)
                ground[sector, between] = height + share * (lowest[sector, number] - height)
            height = lowest[sector, number]
            ground[sector, number] = height
            last = number
        ground[sector, last + 1 :] = height
    return ground


@compiled
def _heights(point_m: Floats, sensor_m: Floats, ground: Floats, bin_m: float) -> Floats:
    sectors, bins = ground.shape
    height = np.empty(len(point_m))
    for row in range(len(point_m)):
        x = point_m[row, 0] - sensor_m[0]
        y = point_m[row, 1] - sensor_m[1]
        sector = int((np.arctan2(y, x) + np.pi) / (2.0 * np.pi) * sectors) % sectors
        at = min(max(np.hypot(x, y) / bin_m - 0.5, 0.0), bins - 1.0)
        number = min(int(at), bins - 2)
        share = at - number
        below = (1.0 - share) * ground[sector, number] + share * ground[sector, number + 1]
        height[row] = point_m[row, 2] - below
    return height
