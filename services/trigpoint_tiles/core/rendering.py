"""What a tile shows, from the cells of every drive there."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.compiled import compiled
from trigpoint_tiles.core.cells import (
    FIELDS,
    GROUND_COUNT,
    GROUND_HEIGHT_MM,
    GROUND_INTENSITY,
    GROUND_SWEEPS,
    HIGH_COUNT,
    HIGH_HIGHEST,
    HIGH_INTENSITY,
    INTENSITY_STEPS,
    LOW_COUNT,
    LOW_HIGHEST,
    LOW_INTENSITY,
    LOW_SWEEPS,
    MM,
    VARIANCE_MM2,
    ZERO_MM,
    Cells,
)

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Bands = NDArray[np.float32]

REFLECTIVITY, GROUND_M, HEIGHT_ABOVE_M, DENSITY_PER_M2, SIGMA_M = range(5)


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """A band's name and unit."""

    name: str
    unit: str
    meaning: str


BANDS = (
    Band(name="reflectivity", unit="1", meaning="mean intensity over that of a usual ground, drives balanced"),
    Band(name="ground_height", unit="m", meaning="mean height of the ground over the plane under the vehicle"),
    Band(name="height_above", unit="m", meaning="highest point over the ground, moving objects left out"),
    Band(name="density", unit="1/m2", meaning="points a square metre"),
    Band(name="sigma", unit="m", meaning="1-sigma per axis of where a point truly lies, root mean square"),
)


(GROUND, LOW, HIGH, HEIGHT_MM, VARIANCE, VOTES, MORE_LOW, GROUND_BRIGHT, LOW_BRIGHT, HIGH_BRIGHT, LOW_TOP, HIGH_TOP) = (
    range(12)
)
SUMS = 12  # of each pixel, over drives


def stands(drives: Iterable[Cells]) -> Flags:
    """Where (h, w) something stands on the ground, by the drives' votes; what only passed or parked has no majority.

    A drive votes for it where at least as many of its sweeps saw something there as saw bare ground. Between as many
    drives for as against it the sweeps decide.
    """
    return _standing(_summed((cells, 1.0) for cells in drives))


def rendered(drives: Iterable[Cells], gains: Sequence[float], *, pixel_area_m2: float) -> Bands:
    """A tile's bands (5, h, w) from the cells (h, w, FIELDS) of one drive at least, one after the other, NaN where
    nothing was seen.

    gains: what each drive's intensities are multiplied with; a pixel covers so many m^2 of ground.
    """
    sums = _summed(zip(drives, gains, strict=True))
    standing = _standing(sums)
    count = sums[GROUND] + np.where(standing, sums[LOW], 0.0)
    seen = count + sums[HIGH]
    near = sums[GROUND_BRIGHT] + np.where(standing, sums[LOW_BRIGHT], 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        ground_m = sums[HEIGHT_MM] / MM / sums[GROUND]
        sigma_m = np.sqrt(sums[VARIANCE] / (sums[GROUND] + sums[LOW] + sums[HIGH])) / MM
        bright = np.where(count > 0.0, near, sums[HIGH_BRIGHT]) / INTENSITY_STEPS
        reflectivity = bright / np.where(count > 0.0, count, sums[HIGH])
    bands = np.stack([reflectivity, ground_m, _height_above_m(sums, standing, ground_m), seen / pixel_area_m2, sigma_m])
    bands[:, seen == 0.0] = np.nan
    return bands.astype(np.float32)


def _summed(drives: Iterable[tuple[Cells, float]]) -> Floats:
    """Sums (SUMS, h, w) over drives, one at least, with their gains; whole numbers but for brightness."""
    sums: Floats | None = None
    for cells, gain in drives:
        if sums is None:
            sums = np.zeros((SUMS, *cells.shape[:2]))
        _sum(cells.reshape(-1, FIELDS), gain, sums.reshape(SUMS, -1))
    if sums is None:
        raise ValueError("a tile of no drive has no size")
    return sums


@compiled
def _sum(cells: Cells, gain: float, sums: Floats) -> None:
    for at in range(len(cells)):
        cell = cells[at]
        low, bare = cell[LOW_SWEEPS], cell[GROUND_SWEEPS]
        sums[GROUND, at] += cell[GROUND_COUNT]
        sums[LOW, at] += cell[LOW_COUNT]
        sums[HIGH, at] += cell[HIGH_COUNT]
        sums[HEIGHT_MM, at] += cell[GROUND_HEIGHT_MM]
        sums[VARIANCE, at] += cell[VARIANCE_MM2]
        sums[VOTES, at] += (1 if low >= bare else -1) if low + bare > 0 else 0
        sums[MORE_LOW, at] += low - bare
        sums[GROUND_BRIGHT, at] += gain * cell[GROUND_INTENSITY]
        sums[LOW_BRIGHT, at] += gain * cell[LOW_INTENSITY]
        sums[HIGH_BRIGHT, at] += gain * cell[HIGH_INTENSITY]
        sums[LOW_TOP, at] = max(sums[LOW_TOP, at], cell[LOW_HIGHEST])
        sums[HIGH_TOP, at] = max(sums[HIGH_TOP, at], cell[HIGH_HIGHEST])


def _standing(sums: Floats) -> Flags:
    return np.asarray((sums[VOTES] > 0) | ((sums[VOTES] == 0) & (sums[MORE_LOW] > 0)))


def _height_above_m(sums: Floats, standing: Flags, ground_m: Floats) -> Floats:
    """The highest point over the ground of its cell, or over the plane under the vehicle where that was not seen."""
    top = np.maximum(np.where(standing, sums[LOW_TOP], 0), sums[HIGH_TOP])
    above_m = (top - ZERO_MM) / MM - np.nan_to_num(ground_m)
    return np.asarray(np.where(top > 0, np.maximum(above_m, 0.0), 0.0))
