"""The points around one sweep of a run: those of the sweeps shortly before and after it, registered to one another."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import small_gicp
from numpy.typing import NDArray

from trigpoint_perception.core.closures.runs import Run
from trigpoint_perception.core.closures.settings import VerificationSettings
from trigpoint_perception.core.deskew import deskewed, planar_path
from trigpoint_perception.core.following import NumberedSweep
from trigpoint_perception.core.ground import heights_above_ground
from trigpoint_perception.core.kept_map import NEIGHBOURS
from trigpoint_perception.core.odometry import LidarOdometry
from trigpoint_perception.core.sweep import Sweep, usable_sweep
from trigpoint_perception.settings import PerceptionSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Cloud:
    """Points in the base's frame at the middle sweep: all of them with their surfaces' covariances and a tree over
    them; and `upright_m` (u, 3) those well above the ground. covariance (3, 3): how well the middle sweep lies among
    the others, x, y and heading in its own frame."""

    points: small_gicp.PointCloud
    tree: small_gicp.KdTree
    upright_m: Floats
    covariance: Floats


def rows_around(run: Run, row: int, settings: VerificationSettings) -> Ints:
    """The sweeps (k,) of a run that make the cloud around one of them, that one included."""
    away_m = run.path_m - run.path_m[row]
    within = np.nonzero(np.abs(away_m) <= settings.half_span_m)[0]
    cell = np.round(away_m[within] / settings.sweep_step_m).astype(np.int64)
    first = within[np.unique(cell, return_index=True)[1]]
    return np.unique(np.append(first[np.round(away_m[first] / settings.sweep_step_m) != 0.0], row))


def cloud_around(
    sweeps: Sequence[NumberedSweep], run: Run, row: int, settings: VerificationSettings, chosen: PerceptionSettings
) -> Cloud:
    """The cloud around a sweep, from the sweeps of `rows_around` in their order.

    Each is deskewed by the run's path and matched to those before it. Raises EventRejected for a sweep that is not
    usable.
    """
    path = planar_path(run.stamp_ns, run.pose)
    odometry = LidarOdometry(chosen.odometry)
    placed: list[tuple[Floats, Floats, Floats]] = []
    T_odom_middle, covariance = np.eye(4), np.zeros((3, 3))
    last, T_odom_last = int(np.searchsorted(run.sequence, sweeps[0].sequence)), np.eye(4)
    for numbered in sweeps:
        at = int(np.searchsorted(run.sequence, numbered.sequence))
        sweep = usable_sweep(numbered.scanned, chosen.sweep)
        still_m = deskewed(sweep.point_m, sweep.offset_ns, stamp_ns=numbered.stamp_ns, path=path)
        sweep = replace(sweep, point_m=still_m)
        match = odometry.matched(still_m, T_odom_last @ _moved(run.pose[last], run.pose[at]))
        last, T_odom_last = at, match.T_odom_base
        if at == row:
            T_odom_middle, covariance = T_odom_last, match.covariance
        placed.append((T_odom_last, *_near(sweep, settings, chosen)))
    points, tree, upright_m = _merged(placed, np.asarray(np.linalg.inv(T_odom_middle), dtype=np.float64), settings)
    return Cloud(points=points, tree=tree, upright_m=upright_m, covariance=covariance)


def _near(sweep: Sweep, settings: VerificationSettings, chosen: PerceptionSettings) -> tuple[Floats, Floats]:
    """The points (n, 3) within range, and those of them (u, 3) well above the ground."""
    height_m = heights_above_ground(sweep, chosen.ground, range_max_m=chosen.sweep.range_max_m)
    near = sweep.run_m <= settings.range_max_m
    return sweep.point_m[near], sweep.point_m[near & (height_m >= settings.upright_min_m)]


def _merged(
    placed: Sequence[tuple[Floats, Floats, Floats]], T_middle_odom: Floats, settings: VerificationSettings
) -> tuple[small_gicp.PointCloud, small_gicp.KdTree, Floats]:
    """All points and the upright ones (u, 3), thinned, at the middle sweep."""
    points, upright = [], []
    for T_odom_base, point_m, upright_m in placed:
        T_middle_base = T_middle_odom @ T_odom_base
        points.append(point_m @ T_middle_base[:3, :3].T + T_middle_base[:3, 3])
        upright.append(upright_m @ T_middle_base[:3, :3].T + T_middle_base[:3, 3])
    cloud, tree = small_gicp.preprocess_points(np.vstack(points), settings.downsampled_m, NEIGHBOURS, 1)
    thinned = small_gicp.voxelgrid_sampling(np.vstack(upright), settings.downsampled_m)
    return cloud, tree, np.asarray(thinned.points())[:, :3]


def _moved(before: Floats, after: Floats) -> Floats:
    """The motion (4, 4) from one planar pose (3,) to another."""
    c, s = np.cos(before[2]), np.sin(before[2])
    step_m = after[:2] - before[:2]
    turned_rad = after[2] - before[2]
    motion = np.eye(4)
    motion[:2, :2] = [[np.cos(turned_rad), -np.sin(turned_rad)], [np.sin(turned_rad), np.cos(turned_rad)]]
    motion[:2, 3] = [c * step_m[0] + s * step_m[1], c * step_m[1] - s * step_m[0]]
    return motion
