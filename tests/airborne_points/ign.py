"""Tiles of IGN's LIDAR HD on an ortho layer: the service's own kernel, rendering and file."""

from pathlib import Path

import laspy
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from trigpoint.events.scanned import PointsScanned
from trigpoint_tiles.core.cells import FIELDS, Cells
from trigpoint_tiles.core.gathering import RangeLimits, Target, gather, no_tally
from trigpoint_tiles.core.grid import TILE_PX, RasterGrid, TileBox, box_of_cells, tiles_of
from trigpoint_tiles.core.placement import STRAIGHT, PlacedSweep, SweepTable
from trigpoint_tiles.core.rendering import Bands, rendered
from trigpoint_tiles.geotiff import write_cog

Floats = NDArray[np.float64]

CRS = "EPSG:2154"
GROUND, ARTEFACT = 2, 64
CELL_M = 1.0  # on which the ground's height is taken
POSITION_SIGMA_M = 0.1  # as IGN states it for the product, horizontally
FAR_M = 10_000.0


def airborne_layer(folder: Path, path: Path, *, resolution_m: float, names: str = "*.laz") -> None:
    """The first returns of all tiles in a folder as an ortho layer."""
    x_m, y_m, above_m, intensity = _points(folder, names)
    grid = RasterGrid(crs=CRS, pixel_m=resolution_m)
    corner_m = np.array([np.floor(x_m.min()), np.floor(y_m.min())])
    sweep = _sweep(np.column_stack([x_m - corner_m[0], y_m - corner_m[1], above_m]), intensity)
    first = np.array([(corner_m[0] - grid.left_m), (grid.top_m - corner_m[1])]) / resolution_m
    column, row = first[0] + (x_m - corner_m[0]) / resolution_m, first[1] - (y_m - corner_m[1]) / resolution_m
    box = box_of_cells(int(column.min()), int(np.floor(row.min())), int(column.max()), int(np.floor(row.max())))
    cells = _gathered(sweep, _table(first, resolution_m), box)
    gain = float(1.0 / np.median(intensity))
    tiles = [(tile, _bands(cells[at], gain, resolution_m)) for at, tile in enumerate(sum(tiles_of(box), []))]
    write_cog(path, grid, box, tiles, tags={"ATTRIBUTION": "IGN", "MAP_VERSION": "0"})


def _bands(cells: Cells, gain: float, resolution_m: float) -> Bands:
    return rendered([cells], [gain], pixel_area_m2=resolution_m**2)


def _points(folder: Path, names: str) -> tuple[Floats, Floats, Floats, Floats]:
    """East, north, height above ground and intensity of first returns."""
    clouds = [laspy.read(path) for path in sorted(folder.glob(names))]
    x_m, y_m, z_m, intensity, kind, number = (
        np.concatenate([np.asarray(cloud[name], dtype=np.float64) for cloud in clouds])
        for name in ("x", "y", "z", "intensity", "classification", "return_number")
    )
    first = (number == 1) & (kind != ARTEFACT)
    above_m = z_m - _ground_m(x_m, y_m, z_m, kind == GROUND)
    return x_m[first], y_m[first], above_m[first], intensity[first]


def _ground_m(x_m: Floats, y_m: Floats, z_m: Floats, ground: NDArray[np.bool_]) -> Floats:
    """The ground's height at each point: of its square metre, or of the nearest that has ground."""
    column, row = ((at - at.min()) // CELL_M for at in (x_m, y_m))
    shape = (int(row.max()) + 1, int(column.max()) + 1)
    index = (row * shape[1] + column).astype(np.int64)
    count = np.bincount(index[ground], minlength=shape[0] * shape[1]).reshape(shape)
    total = np.bincount(index[ground], z_m[ground], minlength=shape[0] * shape[1]).reshape(shape)
    nearest = ndimage.distance_transform_edt(count == 0, return_distances=False, return_indices=True)
    height_m = (total / np.maximum(count, 1))[tuple(nearest)]
    return np.asarray(height_m.ravel()[index])


def _sweep(point_m: Floats, intensity: Floats) -> PointsScanned:
    count = len(point_m)
    return PointsScanned(
        sensor="airborne",
        sensor_position_m=np.zeros(3),
        sensor_orientation=np.array([0.0, 0.0, 0.0, 1.0]),
        point_m=point_m.astype(np.float32),
        intensity=intensity.astype(np.float32),
        offset_ns=np.zeros(count, dtype=np.int32),
        ring=np.zeros(count, dtype=np.uint16),
    )


def _table(first: Floats, resolution_m: float) -> SweepTable:
    scale = 1.0 / resolution_m
    onto = np.array([[scale, 0.0, 0.0, first[0]], [0.0, -scale, 0.0, first[1]]])
    return SweepTable(
        first_ns=0,
        step_ns=1.0,
        to_plane=np.stack([onto, onto]),
        to_height=np.array([0.0, 0.0, 1.0, 0.0]),
        variance=np.array([POSITION_SIGMA_M**2, 0.0]),
    )


def _gathered(sweep: PointsScanned, table: SweepTable, box: TileBox) -> Cells:
    count = box.rows * box.columns
    pool = np.zeros((count, TILE_PX, TILE_PX, FIELDS), dtype=np.int64)
    slot = np.arange(count).reshape(box.rows, box.columns)
    target = Target(column=box.column, row=box.row, slot=slot, pool=pool, tally=no_tally())
    limits = RangeLimits(least_m=0.0, most_m=FAR_M)
    gather(sweep, PlacedSweep(table=table, bend_px=STRAIGHT), target, number=1, limits=limits)
    return pool
