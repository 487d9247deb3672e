"""The ground under a sweep: one profile a sector, walked outwards (after Himmelsbach et al. 2010, by slope)."""

import numpy as np
from numpy.typing import NDArray

from trigpoint.compiled import compiled
from trigpoint_perception.core.sweep import Sweep
from trigpoint_perception.settings import GroundSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SLOPE_OF_ANY = 0.2  # deeper than this below the base frame's ground is a mirrored point, and no ground
DEPTH_OF_ANY_M = 0.25
SMOOTHED_SECTORS = 2  # to either side: a profile is the median of five


def heights_above_ground(sweep: Sweep, settings: GroundSettings, *, range_max_m: float) -> Floats:
    """The height (n,) in m of each point of a sweep above the ground beneath it.

    The walk starts on the base frame's ground. A bin whose lowest point is steeper above or below the last ground than
    `slope_max` and a kerb allow holds no ground; between bins the profile is straight, beyond the last it is level.
    """
    bins = int(np.ceil(range_max_m / settings.bin_m)) + 1
    z_m = sweep.point_m[:, 2]
    sector = _sectors(sweep.azimuth_rad, settings.sectors)
    lowest = _lowest(z_m, sweep.run_m, sector, (settings.sectors, bins), settings.bin_m)
    profile = _profiles(lowest, settings.bin_m, settings.slope_max, settings.step_m)
    return _heights(z_m, sweep.run_m, sector, _smoothed(profile), settings.bin_m)


@compiled
def _sectors(azimuth_rad: Floats, sectors: int) -> Ints:
    """The sector (n,) each direction is in."""
    sector = np.empty(len(azimuth_rad), np.int64)
    for row in range(len(azimuth_rad)):
        sector[row] = int((azimuth_rad[row] + np.pi) / (2.0 * np.pi) * sectors) % sectors
    return sector


@compiled
def _lowest(z_m: Floats, run_m: Floats, sector: Ints, shape: tuple[int, int], bin_m: float) -> Floats:
    """The lowest point's height (sectors, bins), infinite where a bin holds none."""
    lowest = np.full(shape, np.inf)
    for row in range(len(z_m)):
        if z_m[row] >= -SLOPE_OF_ANY * run_m[row] - DEPTH_OF_ANY_M:
            number = min(int(run_m[row] / bin_m), shape[1] - 1)
            lowest[sector[row], number] = min(lowest[sector[row], number], z_m[row])
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
def _smoothed(profile: Floats) -> Floats:
    """The median (sectors, bins) of each sector's height and its neighbours' round the turn."""
    sectors, bins = profile.shape
    smooth = np.empty_like(profile)
    near = np.empty(2 * SMOOTHED_SECTORS + 1)
    for sector in range(sectors):
        for number in range(bins):
            for at in range(len(near)):
                value, place = profile[(sector + at - SMOOTHED_SECTORS) % sectors, number], at
                while place > 0 and near[place - 1] > value:
                    near[place] = near[place - 1]
                    place -= 1
                near[place] = value
            smooth[sector, number] = near[SMOOTHED_SECTORS]
    return smooth


@compiled
def _heights(z_m: Floats, run_m: Floats, sector: Ints, ground: Floats, bin_m: float) -> Floats:
    bins = ground.shape[1]
    height = np.empty(len(z_m))
    for row in range(len(z_m)):
        at = min(max(run_m[row] / bin_m - 0.5, 0.0), bins - 1.0)
        number = min(int(at), bins - 2)
        share = at - number
        below = (1.0 - share) * ground[sector[row], number] + share * ground[sector[row], number + 1]
        height[row] = z_m[row] - below
    return height
