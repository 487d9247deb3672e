"""Where the points of a sweep fall on a grid: its pose at each point's own time, and the way from the map to pixels."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.scanned import PointsScanned
from trigpoint.geodesy.poses import transform_points
from trigpoint.geodesy.projection import MapFrame, transform_coordinates
from trigpoint_tiles.core.driven_path import DrivenPath
from trigpoint_tiles.core.grid import RasterGrid, TileBox, box_of_cells

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ENTRY_NS = 4_000_000  # between two entries of a table; what is between is off by 0.1 mm at 60 m and 1 rad/s
AFFINE_ERROR_PX = 0.05  # a projection that bends more than that within a sweep's reach is followed point by point
AFFINE_SAMPLES = 5  # a side of the square on which the bend is measured
LEVER_MOST_M = 10.0  # from the base to a sensor, and what the base moves during a sweep
SQUARE_M = 64.0  # of ground that shares an affine
RANGE_SIGMA_M = 0.03  # a lidar's own, in range and across


@dataclass(frozen=True, slots=True, kw_only=True)
class PixelAffine:
    """From the map frame to pixels: column, row = `matrix` (2, 2) times x, y in m, plus `offset` (2,).

    `error_px` is the most it is off from the exact projection on a square around where it was fitted.
    """

    matrix: Floats
    offset: Floats
    error_px: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepTable:
    """A sweep's way onto a plane while it was measured, m entries `step_ns` apart from `first_ns` after its stamp.

    `to_plane` (m, 2, 4): a point x, y, z, 1 of the sensor to the plane's two coordinates; `to_height` (4,): to metres
    above the ground under the base. A point at range r has a variance per axis of variance[0] + r^2 variance[1], m^2.
    """

    first_ns: int
    step_ns: float
    to_plane: Floats
    to_height: Floats
    variance: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedSweep:
    """A sweep's table onto cells, and what its projection bends beside it: bend_px (n, 2) for each point, or (0, 2)
    where that is nothing to speak of."""

    table: SweepTable
    bend_px: Floats


STRAIGHT = np.zeros((0, 2))


def exact_pixels(point_m: Floats, frame: MapFrame, grid: RasterGrid) -> Floats:
    """Columns and rows (n, 2), with fractions, of map positions (n, 2) in m."""
    easting_m, northing_m = point_m[:, 0] + frame.origin_easting_m, point_m[:, 1] + frame.origin_northing_m
    if frame.crs != grid.crs:
        easting_m, northing_m = transform_coordinates(easting_m, northing_m, source_crs=frame.crs, target_crs=grid.crs)
    return np.column_stack([(easting_m - grid.left_m) / grid.pixel_m, (grid.top_m - northing_m) / grid.pixel_m])


def pixel_affine(centre_m: Floats, frame: MapFrame, grid: RasterGrid, *, reach_m: float) -> PixelAffine:
    """The affine nearest to the projection, by least squares on a square of samples `reach_m` around a place (2,)."""
    side_m = np.linspace(-reach_m, reach_m, AFFINE_SAMPLES)
    from_centre_m = np.stack(np.meshgrid(side_m, side_m), axis=-1).reshape(-1, 2)
    pixel = exact_pixels(centre_m + from_centre_m, frame, grid)
    middle = pixel.mean(axis=0)
    matrix = np.linalg.lstsq(from_centre_m, pixel - middle, rcond=None)[0].T
    left = pixel - middle - from_centre_m @ matrix.T
    return PixelAffine(matrix=matrix, offset=middle - matrix @ centre_m, error_px=float(np.abs(left).max()))


def sweep_span_ns(sweep: PointsScanned, stamp_ns: int) -> tuple[int, int]:
    """When a sweep's first and last point were measured."""
    return stamp_ns + int(sweep.offset_ns.min(initial=0)), stamp_ns + int(sweep.offset_ns.max(initial=0))


def sweep_table(
    sweep: PointsScanned, stamp_ns: int, path: DrivenPath, plane: PixelAffine, *, deskew: bool = True
) -> SweepTable:
    """The table of a sweep whose time the path holds, onto a plane that is affine to the map; without `deskew` as if
    all its points were measured at its stamp."""
    first_ns, last_ns = sweep_span_ns(sweep, stamp_ns)
    steps = max(1, -(-(last_ns - first_ns) // ENTRY_NS))
    step_ns = max((last_ns - first_ns) / steps, 1.0)
    at_ns = first_ns + np.round(np.arange(steps + 1) * (last_ns - first_ns) / steps).astype(np.int64)
    pose = path.poses_at(at_ns if deskew else np.full_like(at_ns, stamp_ns))
    T_base_sensor = np.column_stack([_rotation(sweep.sensor_orientation), sweep.sensor_position_m])
    covariance = path.covariance_at(stamp_ns)
    return SweepTable(
        first_ns=first_ns - stamp_ns,
        step_ns=step_ns,
        to_plane=_to_plane(pose, T_base_sensor, plane),
        to_height=T_base_sensor[2].copy(),
        variance=np.array([0.5 * (covariance[0, 0] + covariance[1, 1]) + RANGE_SIGMA_M**2, covariance[2, 2]]),
    )


class SweepPlacer:
    """Places sweeps on a grid; the affine of each square of ground is worked out once."""

    def __init__(self, frame: MapFrame, grid: RasterGrid, *, reach_m: float, deskew: bool = True) -> None:
        """No point counts that is farther than `reach_m` from its sensor; without `deskew` all of a sweep's are placed
        by the pose at its stamp."""
        self._frame, self._grid, self._deskew = frame, grid, deskew
        self._reach_m = reach_m + LEVER_MOST_M
        self._affines: dict[tuple[int, int], PixelAffine] = {}

    def placed(self, sweep: PointsScanned, stamp_ns: int, path: DrivenPath) -> tuple[PlacedSweep, TileBox]:
        """A sweep whose time the path holds, and the tiles within its reach."""
        base_m = path.poses_at(np.array([stamp_ns], dtype=np.int64))[0, :2]
        affine = self._affine(base_m)
        table = sweep_table(sweep, stamp_ns, path, affine, deskew=self._deskew)
        box = box_of_cells(*self.reached_cells(base_m))
        bend_px = STRAIGHT if affine.error_px <= AFFINE_ERROR_PX else self._bend_px(sweep, stamp_ns, path, affine)
        return PlacedSweep(table=table, bend_px=bend_px), box

    def reached_cells(self, base_m: Floats) -> tuple[int, int, int, int]:
        """The cells west, north, east and south within reach of a place (2,) of the base in the map."""
        affine = self._affine(base_m)
        column, row = affine.matrix @ base_m + affine.offset
        reach = self._reach_m * math.sqrt(float((affine.matrix**2).sum())) + 1.0
        return (
            math.floor(column - reach),
            math.floor(row - reach),
            math.floor(column + reach),
            math.floor(row + reach),
        )

    def _affine(self, base_m: Floats) -> PixelAffine:
        square = (math.floor(base_m[0] / SQUARE_M), math.floor(base_m[1] / SQUARE_M))
        if square not in self._affines:
            centre_m = (np.array(square) + 0.5) * SQUARE_M
            reach_m = self._reach_m + SQUARE_M / 2
            self._affines[square] = pixel_affine(centre_m, self._frame, self._grid, reach_m=reach_m)
        return self._affines[square]

    def _bend_px(self, sweep: PointsScanned, stamp_ns: int, path: DrivenPath, affine: PixelAffine) -> Floats:
        """How far (n, 2) the exact projection of each point lies from the affine one."""
        pose = path.poses_at(stamp_ns + sweep.offset_ns.astype(np.int64) * self._deskew)
        T_base_sensor = np.column_stack([_rotation(sweep.sensor_orientation), sweep.sensor_position_m])
        near = np.nan_to_num(sweep.point_m.astype(np.float64), posinf=0.0, neginf=0.0)
        far = np.linalg.norm(near, axis=1) > self._reach_m
        base_m = np.where(far[:, None], 0.0, near) @ T_base_sensor[:, :3].T + T_base_sensor[:, 3]
        point_m = transform_points(pose, base_m[:, :2])
        straight_px: Floats = point_m @ affine.matrix.T + affine.offset
        return np.asarray(exact_pixels(point_m, self._frame, self._grid) - straight_px, dtype=np.float64)


def _to_plane(pose: Floats, T_base_sensor: Floats, plane: PixelAffine) -> Floats:
    """From sensor to plane (m, 2, 4) at poses (m, 3), with the sensor in the base (3, 4)."""
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    turn = np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)
    linear: Floats = plane.matrix @ turn @ T_base_sensor[:2]
    linear[:, :, 3] += pose[:, :2] @ plane.matrix.T + plane.offset
    return linear


def _rotation(quaternion: Floats) -> Floats:
    """The matrix (3, 3) of a unit quaternion x, y, z, w."""
    x, y, z, w = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
