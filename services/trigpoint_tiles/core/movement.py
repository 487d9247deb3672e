"""Which tiles a new map version changes: those of sweeps that moved by more than a pixel, where they were and are."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.geodesy.poses import wrap_angles_rad
from trigpoint_tiles.core.grid import RasterGrid, Tile, box_of_cells, tiles_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


NOTHING_HIT = np.array([0, 0, -1, -1], dtype=np.int64)  # a box of no cell


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedSweeps:
    """A drive's sweeps as they are gathered: `sequence` (n,) names each one's event; pose (n, 3): x, y in m, heading in
    rad, base in map, at its stamp; box (n, 4): west, north, east and south cells hit, west past east where none was."""

    sequence: Ints
    pose: Floats
    box: Ints


def moved_px(before: Floats, now: Floats, grid: RasterGrid, *, reach_m: float) -> Floats:
    """How far (n,) the farthest points of sweeps at poses (n, 3) moved between two versions, in pixels at most."""
    turn_rad = np.abs(wrap_angles_rad(now[:, 2] - before[:, 2]))
    return np.asarray((np.hypot(*(now - before)[:, :2].T) + reach_m * turn_rad) / grid.pixel_m)


def tiles_near(box: Ints, *, margin_px: int) -> frozenset[Tile]:
    """The tiles within so many cells of a box (4,) of cells: west, north, east, south; none where west is past east."""
    west, north, east, south = box.tolist()
    if west > east:
        return frozenset()
    found = box_of_cells(west - margin_px, north - margin_px, east + margin_px, south + margin_px)
    return frozenset(tile for row in tiles_of(found) for tile in row)


def changed_tiles(before: PlacedSweeps, now: PlacedSweeps, grid: RasterGrid, *, reach_m: float) -> frozenset[Tile]:
    """The tiles of sweeps that moved by more than a pixel, as they were and are, and of those only one version has.

    The boxes in `now` count only of sweeps that `before` does not have.
    """
    _, old, new = np.intersect1d(before.sequence, now.sequence, return_indices=True)
    moved = moved_px(before.pose[old], now.pose[new], grid, reach_m=reach_m)
    gone = np.setdiff1d(np.arange(len(before.sequence)), old)
    added = np.setdiff1d(np.arange(len(now.sequence)), new)
    found = [tiles_near(before.box[at], margin_px=0) for at in gone]
    found += [tiles_near(now.box[at], margin_px=0) for at in added]
    found += [
        tiles_near(before.box[at], margin_px=math.ceil(by) + 1) for at, by in zip(old, moved, strict=True) if by > 1.0
    ]
    return frozenset[Tile]().union(*found)
