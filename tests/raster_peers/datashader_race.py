"""The same points from sensor to mean raster, by the service's kernel and by NumPy, pyproj and datashader, on one core.

Both interpolate the pose at every point's time, project from the map's CRS to the raster's and gather the mean
intensity a cell; the kernel gathers heights, votes and sigma besides. Each side is timed by its processor time.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numba
import numpy as np
import pandas
from datashader import Canvas
from datashader.reductions import mean
from numpy.typing import NDArray

from scanned_drives.examples import FRAME, SENSOR_M, START_NS, SWEEP_NS, arc, solved_path
from trigpoint.events.scanned import PointsScanned
from trigpoint.geodesy.poses import transform_points
from trigpoint_tiles.core.accumulator import SLOT_BYTES, Accumulator
from trigpoint_tiles.core.driven_path import DrivenPath, path_of
from trigpoint_tiles.core.gathering import RangeLimits
from trigpoint_tiles.core.grid import RasterGrid, projected_grid, web_mercator_zoom
from trigpoint_tiles.core.placement import SweepPlacer, exact_pixels

Floats = NDArray[np.float64]

SWEEPS, BEAMS, DIRECTIONS, RUNS = 100, 16, 1800, 3
POINTS = BEAMS * DIRECTIONS
SENSOR_HEIGHT_M, WALLS_M, RANGE_SIGMA_M = 1.9, 35.0, 0.02
WEB, OWN = web_mercator_zoom(20), projected_grid(FRAME.crs, resolution_m=0.1)
LIMITS = RangeLimits(least_m=0.0)


@dataclass(frozen=True, slots=True)
class Race:
    """Points a second of each side, the best of the runs."""

    kernel: float
    datashader: float

    @property
    def ratio(self) -> float:
        """How many times as fast the kernel is."""
        return self.kernel / self.datashader


def race(grid: RasterGrid) -> Race:
    """Both on the same sweeps, one after the other."""
    numba.set_num_threads(1)
    path = path_of(solved_path("car", arc(0.1 * SWEEPS + 1.0)))
    random = np.random.default_rng(1)
    rows = [(START_NS + SWEEP_NS * number, turn(random)) for number in range(SWEEPS)]
    total = SWEEPS * POINTS
    by_kernel = _best(lambda: _gather(rows, path, grid))
    return Race(total / by_kernel, total / _best(lambda: _shade(rows, path, grid)))


def turn(random: np.random.Generator) -> PointsScanned:
    """One turn of a spinning lidar of 16 beams, 30 degrees high, over flat ground between walls all around."""
    bearing_rad = np.repeat(np.linspace(0.0, 2.0 * np.pi, DIRECTIONS, endpoint=False), BEAMS)
    up_rad = np.tile(np.radians(np.linspace(-15.0, 15.0, BEAMS)), DIRECTIONS)
    to_ground_m = SENSOR_HEIGHT_M / np.maximum(np.sin(-up_rad), 1e-6)
    range_m = np.minimum(to_ground_m, WALLS_M) + random.normal(0.0, RANGE_SIGMA_M, POINTS)
    flat_m = range_m * np.cos(up_rad)
    point_m = np.column_stack([flat_m * np.cos(bearing_rad), flat_m * np.sin(bearing_rad), range_m * np.sin(up_rad)])
    return PointsScanned(
        sensor="lidar",
        sensor_position_m=SENSOR_M,
        sensor_orientation=np.array([0.0, 0.0, 0.0, 1.0]),
        point_m=point_m.astype(np.float32),
        intensity=random.uniform(0.0, 100.0, POINTS).astype(np.float32),
        offset_ns=np.repeat(np.arange(DIRECTIONS) * (SWEEP_NS // DIRECTIONS), BEAMS).astype(np.int32),
        ring=np.tile(np.arange(BEAMS), DIRECTIONS).astype(np.uint16),
    )


def _best(work: Callable[[], object]) -> float:
    """The least processor time of some runs, after one that compiles, in s."""
    work()
    seconds = []
    for _ in range(RUNS):
        began_s = time.process_time()
        work()
        seconds.append(time.process_time() - began_s)
    return min(seconds)


def _gather(rows: list[tuple[int, PointsScanned]], path: DrivenPath, grid: RasterGrid) -> None:
    accumulator = Accumulator(memory_bytes=64 * SLOT_BYTES, hand_on=lambda tile, cells: None)
    placer = SweepPlacer(FRAME, grid, reach_m=60.0)
    for stamp_ns, sweep in rows:
        placed, box = placer.placed(sweep, stamp_ns, path)
        accumulator.add(sweep, placed, box, LIMITS)


def _shade(rows: list[tuple[int, PointsScanned]], path: DrivenPath, grid: RasterGrid) -> None:
    """All sweeps in one raster: what suits datashader best."""
    cells = np.concatenate([_cells(stamp_ns, sweep, path, grid) for stamp_ns, sweep in rows])
    intensity = np.concatenate([sweep.intensity for _, sweep in rows])
    (west, north), (east, south) = np.floor(cells.min(axis=0)), np.ceil(cells.max(axis=0))
    canvas = Canvas(int(east - west), int(south - north), x_range=(west, east), y_range=(north, south))
    canvas.points(pandas.DataFrame({"x": cells[:, 0], "y": cells[:, 1], "i": intensity}), "x", "y", mean("i"))


def _cells(stamp_ns: int, sweep: PointsScanned, path: DrivenPath, grid: RasterGrid) -> Floats:
    at_s, path_s = sweep.offset_ns * 1e-9, (path.stamp_ns - stamp_ns) * 1e-9
    pose = np.column_stack([np.interp(at_s, path_s, path.pose[:, axis]) for axis in range(3)])
    base_m = sweep.point_m[:, :2].astype(np.float64) + SENSOR_M[:2]
    return exact_pixels(transform_points(pose, base_m), FRAME, grid)
