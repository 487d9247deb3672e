"""How bright each drive's lidar saw the ground, so that no seam shows where one drive's pixels meet another's."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint_tiles.core.cells import GROUND_COUNT, GROUND_INTENSITY, INTENSITY_STEPS, Cells

Floats = NDArray[np.float64]

STEPS_PER_OCTAVE = 64  # gains are rounded to 1.1 %, so that a small change of one drive leaves the others' pixels alone
POINTS_LEAST = 2  # of a cell, for it to say how bright it is
RATIO_LIMIT = 2.0  # octaves; a cell that differs more changed between the drives
LEVEL_WEIGHT = 1.0  # of a drive's own mean, beside one for each cell two drives share


@dataclass(frozen=True, slots=True, kw_only=True)
class Brightness:
    """A tile's ground as drives saw it: of each the summed log2 of its cells' mean intensities and their count, of each
    two drives, by name, the summed log2 ratios (first over second) of the cells they share, and their count."""

    levels: Mapping[str, tuple[float, int]]
    ratios: Mapping[tuple[str, str], tuple[float, int]]


def brightness(drives: Iterable[tuple[str, Cells]]) -> Brightness:
    """How bright a tile's drives, each with its name, saw its ground."""
    levels, ratios, logs = {}, {}, {}
    for name, cells in drives:
        enough = (cells[..., GROUND_COUNT] >= POINTS_LEAST) & (cells[..., GROUND_INTENSITY] > 0)
        mean = cells[..., GROUND_INTENSITY] / np.maximum(cells[..., GROUND_COUNT], 1) / INTENSITY_STEPS
        logs[name] = np.where(enough, np.log2(np.where(enough, mean, 1.0)), np.nan)
        levels[name] = (float(np.nansum(logs[name])), int(enough.sum()))
    names = sorted(logs)
    for at, first in enumerate(names):
        for second in names[at + 1 :]:
            ratio = np.clip(logs[first] - logs[second], -RATIO_LIMIT, RATIO_LIMIT)
            ratios[first, second] = (float(np.nansum(ratio)), int(np.isfinite(ratio).sum()))
    return Brightness(levels=levels, ratios=ratios)


def balanced_gains(tiles: Sequence[Brightness]) -> dict[str, float]:
    """What each drive's intensities are multiplied with, so that shared ground is as bright in all, and ground 1 on
    the whole: least squares in the logarithm, rounded."""
    names = sorted({name for tile in tiles for name in tile.levels})
    number = {name: at for at, name in enumerate(names)}
    normal, right = np.eye(len(names)) * LEVEL_WEIGHT, np.zeros(len(names))
    for name, at in number.items():
        total = [tile.levels[name] for tile in tiles if name in tile.levels]
        right[at] = -LEVEL_WEIGHT * sum(one[0] for one in total) / max(sum(one[1] for one in total), 1)
    for tile in tiles:
        for (first, second), (ratio, count) in tile.ratios.items():
            a, b = number[first], number[second]
            normal[[a, b], [a, b]] += count
            normal[[a, b], [b, a]] -= count
            right[a] -= ratio
            right[b] += ratio
    octaves = np.linalg.solve(normal, right) if names else np.zeros(0)
    rounded = np.round(octaves * STEPS_PER_OCTAVE) / STEPS_PER_OCTAVE
    return {name: float(2.0 ** rounded[at]) for name, at in number.items()}
