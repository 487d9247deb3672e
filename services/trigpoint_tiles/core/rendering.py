"""What a tile shows, from the cells of every drive there."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint_tiles.core.cells import (
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


def stands(drives: Sequence[Cells]) -> Flags:
    """Where (h, w) something stands on the ground, by the drives' votes; what only passed or parked has no majority.

    A drive votes for it where at least as many of its sweeps saw something there as saw bare ground. Between as many
    drives for as against it the sweeps decide.
    """
    low = np.array([cells[..., LOW_SWEEPS] for cells in drives])
    bare = np.array([cells[..., GROUND_SWEEPS] for cells in drives])
    votes = np.where(low + bare > 0, np.where(low >= bare, 1, -1), 0).sum(axis=0)
    return np.asarray((votes > 0) | ((votes == 0) & (low.sum(axis=0) > bare.sum(axis=0))))


def rendered(drives: Sequence[Cells], gains: Sequence[float], *, pixel_area_m2: float) -> Bands:
    """A tile's bands (5, h, w) from drives' cells (h, w, FIELDS), NaN where nothing was seen.

    gains: what each drive's intensities are multiplied with; a pixel covers so many m^2 of ground.
    """
    standing = stands(drives)
    ground = _summed(drives, GROUND_COUNT)
    high = _summed(drives, HIGH_COUNT)
    count = ground + np.where(standing, _summed(drives, LOW_COUNT), 0.0)
    seen = count + high
    with np.errstate(divide="ignore", invalid="ignore"):
        ground_m = _summed(drives, GROUND_HEIGHT_MM) / MM / ground
        every = seen + np.where(standing, 0.0, _summed(drives, LOW_COUNT))
        sigma_m = np.sqrt(_summed(drives, VARIANCE_MM2) / every) / MM
        reflectivity = _strength(drives, gains, standing) / np.where(count > 0.0, count, high)
    bands = np.stack(
        [reflectivity, ground_m, _height_above_m(drives, standing, ground_m), seen / pixel_area_m2, sigma_m]
    )
    bands[:, seen == 0.0] = np.nan
    return bands.astype(np.float32)


def _summed(drives: Sequence[Cells], field: int) -> Floats:
    return np.asarray(np.sum([cells[..., field] for cells in drives], axis=0), dtype=np.float64)


def _strength(drives: Sequence[Cells], gains: Sequence[float], standing: Flags) -> Floats:
    """Summed intensities of what stands near the ground; of what is high where there is nothing else."""
    near, high = np.zeros(standing.shape), np.zeros(standing.shape)
    count = np.zeros(standing.shape, dtype=np.int64)
    for cells, gain in zip(drives, gains, strict=True):
        near += gain * (cells[..., GROUND_INTENSITY] + np.where(standing, cells[..., LOW_INTENSITY], 0))
        high += gain * cells[..., HIGH_INTENSITY]
        count += cells[..., GROUND_COUNT] + np.where(standing, cells[..., LOW_COUNT], 0)
    return np.where(count > 0, near, high) / INTENSITY_STEPS


def _height_above_m(drives: Sequence[Cells], standing: Flags, ground_m: Floats) -> Floats:
    """The highest point over the ground of its cell, or over the plane under the vehicle where that was not seen."""
    low = np.max([cells[..., LOW_HIGHEST] for cells in drives], axis=0)
    high = np.max([cells[..., HIGH_HIGHEST] for cells in drives], axis=0)
    top = np.maximum(np.where(standing, low, 0), high)
    above_m = (top - ZERO_MM) / MM - np.nan_to_num(ground_m)
    return np.asarray(np.where(top > 0, np.maximum(above_m, 0.0), 0.0))
