"""The points around one sweep of a run: those of the sweeps shortly before and after it, registered to one another."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import small_gicp
from numpy.typing import NDArray

from trigpoint.errors import EventRejected
from trigpoint.geodesy.poses import Pose2
from trigpoint_perception.core.closures.runs import Run
from trigpoint_perception.core.closures.settings import VerificationSettings
from trigpoint_perception.core.deskew import deskewed, planar_path
from trigpoint_perception.core.following import NumberedSweep
from trigpoint_perception.core.ground import heights_above_ground
from trigpoint_perception.core.kept_map import NEIGHBOURS
from trigpoint_perception.core.odometry import LidarOdometry, Match
from trigpoint_perception.core.planar import spatial_pose
from trigpoint_perception.core.sweep import Sweep, usable_sweep
from trigpoint_perception.settings import PerceptionSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SWEEPS_MIN = 2  # one alone says nothing of how well it lies


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
    usable, and "points gone" where the middle one is missing or alone.
    """
    path, odometry = planar_path(run.stamp_ns, run.pose), LidarOdometry(chosen.odometry)
    rows = np.searchsorted(run.sequence, [numbered.sequence for numbered in sweeps]).tolist()
    if row not in rows or len(rows) < SWEEPS_MIN:
        raise EventRejected("points gone", f"{len(rows)} sweeps around sweep {int(run.sequence[row])}, or not it")
    placed: list[_PlacedSweep] = []
    for at, numbered in zip(rows, sweeps, strict=True):
        sweep = usable_sweep(numbered.scanned, chosen.sweep)
        still_m = deskewed(sweep.point_m, sweep.offset_ns, stamp_ns=numbered.stamp_ns, path=path)
        moved = _moved(run.pose[rows[len(placed) - 1]], run.pose[at]) if placed else np.eye(4)
        match = odometry.matched(still_m, placed[-1].match.T_odom_base @ moved if placed else moved)
        placed.append(_PlacedSweep(match, *_near(replace(sweep, point_m=still_m), settings, chosen)))
    middle = rows.index(row)
    points, tree, upright_m = _merged(placed, np.linalg.inv(placed[middle].match.T_odom_base), settings)
    return Cloud(points=points, tree=tree, upright_m=upright_m, covariance=placed[max(middle, 1)].match.covariance)


@dataclass(frozen=True, slots=True)
class _PlacedSweep:
    """A sweep's place among the others, its points (n, 3) within range, and those of them well above the ground."""

    match: Match
    point_m: Floats
    upright_m: Floats


def _near(sweep: Sweep, settings: VerificationSettings, chosen: PerceptionSettings) -> tuple[Floats, Floats]:
    """The points (n, 3) within range, and those of them (u, 3) well above the ground."""
    height_m = heights_above_ground(sweep, chosen.ground, range_max_m=chosen.sweep.range_max_m)
    near = sweep.run_m <= settings.range_max_m
    return sweep.point_m[near], sweep.point_m[near & (height_m >= settings.upright_min_m)]


def _merged(
    placed: Sequence[_PlacedSweep], T_middle_odom: NDArray[np.floating], settings: VerificationSettings
) -> tuple[small_gicp.PointCloud, small_gicp.KdTree, Floats]:
    """All points and the upright ones (u, 3), thinned, at the middle sweep."""
    points, upright = [], []
    for each in placed:
        T_middle_base = T_middle_odom @ each.match.T_odom_base
        points.append(each.point_m @ T_middle_base[:3, :3].T + T_middle_base[:3, 3])
        upright.append(each.upright_m @ T_middle_base[:3, :3].T + T_middle_base[:3, 3])
    cloud, tree = small_gicp.preprocess_points(np.vstack(points), settings.downsampled_m, NEIGHBOURS, 1)
    upright_m = np.vstack(upright)
    if not len(upright_m):
        return cloud, tree, upright_m
    thinned = small_gicp.voxelgrid_sampling(upright_m, settings.downsampled_m)
    return cloud, tree, np.asarray(thinned.points())[:, :3]


def _moved(before: Floats, after: Floats) -> Floats:
    """The motion (4, 4) from one planar pose (3,) to another."""
    motion = Pose2(*before).inverse().compose(Pose2(*after))
    return spatial_pose(np.array([motion.x_m, motion.y_m, motion.heading_rad]))
