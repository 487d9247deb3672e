"""Which tiles were observed when: those whose middle a sweep of a vehicle could reach.

A drive's sweeps are placed on its solved path at their times. A sweep observes what lies within the farthest range at
which the drive ever detected anything, all around; what stood in the way is not known. So a tile without a pass was
not observed, and one with a pass was within reach.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.geodesy.web_tiles import tile_coordinates, tile_size_m

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

COVERAGE_ZOOM = 20  # tiles of some 30 m at 35 degrees of latitude
PAUSE_NS = 60_000_000_000  # without a sweep in a tile for longer, what follows is another pass
CHUNK_SWEEPS = 20_000  # worked on at once
REACH_MOST_TILES = 64  # a range of some kilometres: farther nothing is seen from a vehicle

COLUMN, ROW, FIRST, LAST, COUNT = range(5)


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepPlaces:
    """Where one drive looked from: times (n,) in ns, ascending, latitudes and longitudes (n,) in degrees, and how far
    in m."""

    stamp_ns: Ints
    lat_deg: Floats
    lon_deg: Floats
    range_m: float


def passes_over_tiles(places: SweepPlaces) -> Ints:
    """Passes (m, 5): column and row of the tile, first and last time in ns, number of sweeps; sorted by tile, time."""
    found = np.empty((0, 5), dtype=np.int64)
    for start in range(0, len(places.stamp_ns), CHUNK_SWEEPS):
        part = slice(start, start + CHUNK_SWEEPS)
        stamp_ns, tiles = _observed(places, part)
        ones = np.ones(len(stamp_ns), dtype=np.int64)
        found = _joined(np.concatenate([found, np.column_stack([tiles, stamp_ns, stamp_ns, ones])]))
    return found


def places_on_path(path_stamp_ns: Ints, path_m: Floats, sweep_ns: Ints) -> tuple[Ints, Floats]:
    """The sweeps (k,) that lie within a path's time, and their positions (k, 2) between its poses (n, 2) in m."""
    within = (sweep_ns >= path_stamp_ns[0]) & (sweep_ns <= path_stamp_ns[-1])
    stamp_ns = np.sort(sweep_ns[within])
    at_s, path_s = (stamp_ns - path_stamp_ns[0]) * 1e-9, (path_stamp_ns - path_stamp_ns[0]) * 1e-9
    return stamp_ns, np.column_stack([np.interp(at_s, path_s, path_m[:, axis]) for axis in (0, 1)])


def _observed(places: SweepPlaces, part: slice) -> tuple[Ints, Ints]:
    """Times (k,) of sweeps and tiles (k, 2) whose middle each could reach."""
    lat_deg = places.lat_deg[part]
    at = np.column_stack(tile_coordinates(lat_deg, places.lon_deg[part], COVERAGE_ZOOM))
    reach = places.range_m / tile_size_m(lat_deg, COVERAGE_ZOOM)
    most = min(math.ceil(float(reach.max(initial=0.0))), REACH_MOST_TILES)
    own = np.floor(at).astype(np.int64)
    stamps, tiles = [], []
    for east in range(-most, most + 1):
        for south in range(-most, most + 1):
            tile = own + np.array([east, south])
            reached = np.hypot(*(tile + 0.5 - at).T) <= reach
            stamps.append(places.stamp_ns[part][reached])
            tiles.append(tile[reached])
    return np.concatenate(stamps), np.concatenate(tiles)


def _joined(rows: Ints) -> Ints:
    """Passes over the same tile without a longer pause between them as one."""
    if not len(rows):
        return rows
    rows = rows[np.lexsort((rows[:, FIRST], rows[:, ROW], rows[:, COLUMN]))]
    same = (rows[1:, COLUMN] == rows[:-1, COLUMN]) & (rows[1:, ROW] == rows[:-1, ROW])
    goes_on = same & (rows[1:, FIRST] - rows[:-1, LAST] <= PAUSE_NS)
    first = np.flatnonzero(np.concatenate([[True], ~goes_on]))
    joined = rows[first]
    joined[:, LAST] = np.maximum.reduceat(rows[:, LAST], first)
    joined[:, COUNT] = np.add.reduceat(rows[:, COUNT], first)
    return joined
