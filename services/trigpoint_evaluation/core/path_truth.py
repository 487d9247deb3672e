"""Solved paths against the true ones."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.drives import Drive
from trigpoint.events.mapped import TrajectorySolved
from trigpoint.events.truth import Truth, TruthFixes, TruthPath
from trigpoint.geodesy.poses import transform_points, wrap_angles_rad
from trigpoint.geodesy.projection import MapFrame, map_points_from_wgs84
from trigpoint_evaluation.core.paths import poses_at
from trigpoint_evaluation.core.summary import ErrorSummary, distances_m, summary_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TRUTH_GAP_LIMIT_S = 5.0  # truth is not made up over longer gaps


@dataclass(frozen=True, slots=True, kw_only=True)
class PathTruthEvaluation:
    """Errors of one vehicle's paths, or of all together, at the stamps of the truth and at the instants of fixes.

    `error_m` is the base's distance from truth wherever truth is known, gaps between fixes included;
    `heading_rmse_rad` goes with it. `raw_fix_error_m` is the receivers' own error at their fixes,
    `error_at_fixes_m` that of the solved path there, `ratio_at_fixes` the second's mean over the first's.
    """

    vehicle: str
    error_m: ErrorSummary
    heading_rmse_rad: float
    raw_fix_error_m: ErrorSummary
    error_at_fixes_m: ErrorSummary

    @property
    def ratio_at_fixes(self) -> float:
        """Mean error of the path over mean error of the raw fixes, at the same instants."""
        return self.error_at_fixes_m.mean / self.raw_fix_error_m.mean if self.raw_fix_error_m.mean else float("nan")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Errors:
    vehicle: str
    path_m: Floats
    heading_rad: Floats
    raw_m: Floats
    at_fixes_m: Floats


def evaluate_paths(
    trajectories: Sequence[TrajectorySolved], drives: Sequence[Drive], truth: Truth, frame: MapFrame
) -> tuple[PathTruthEvaluation, tuple[PathTruthEvaluation, ...]]:
    """The evaluation of all paths together, and of each vehicle; vehicles without truth are left out."""
    true_paths = {path.vehicle: path for path in truth.paths}
    true_fixes = {fixes.vehicle: fixes for fixes in truth.fixes}
    by_name = {(drive.vehicle, drive.boot_id): drive for drive in drives}
    errors = [
        _errors(
            trajectory,
            by_name.get((trajectory.vehicle, trajectory.boot_id)),
            true_paths[trajectory.vehicle],
            true_fixes.get(trajectory.vehicle),
            frame,
        )
        for trajectory in trajectories
        if trajectory.vehicle in true_paths
    ]
    vehicles = sorted({one.vehicle for one in errors})
    each = tuple(_evaluation(name, [one for one in errors if one.vehicle == name]) for name in vehicles)
    return _evaluation("", errors), each


def _errors(
    trajectory: TrajectorySolved, drive: Drive | None, path: TruthPath, fixes: TruthFixes | None, frame: MapFrame
) -> _Errors:
    true_pose = np.column_stack([map_points_from_wgs84(path.lat_deg, path.lon_deg, frame), path.heading_rad])
    solved = poses_at(trajectory.stamp_ns, trajectory.pose, at_ns=path.stamp_ns)
    turned = wrap_angles_rad(solved[:, 2] - true_pose[:, 2])
    at_fixes_m, raw_m = np.zeros(0), np.zeros(0)
    if drive is not None and len(drive.fixes.stamp_ns) and len(path.stamp_ns):
        at_ns = drive.fixes.stamp_ns
        truth_there = poses_at(path.stamp_ns, true_pose, at_ns=at_ns, gap_limit_s=TRUTH_GAP_LIMIT_S)
        solved_there = poses_at(trajectory.stamp_ns, trajectory.pose, at_ns=at_ns)
        antenna_m = _true_antenna_m(drive, truth_there, fixes, frame)
        raw_m = distances_m(map_points_from_wgs84(drive.fixes.lat_deg, drive.fixes.lon_deg, frame), antenna_m)
        at_fixes_m = distances_m(solved_there[:, :2], truth_there[:, :2])
        both = np.isfinite(raw_m) & np.isfinite(at_fixes_m)
        raw_m, at_fixes_m = raw_m[both], at_fixes_m[both]
    return _Errors(
        vehicle=trajectory.vehicle,
        path_m=distances_m(solved[:, :2], true_pose[:, :2]),
        heading_rad=turned,
        raw_m=raw_m,
        at_fixes_m=at_fixes_m,
    )


def _true_antenna_m(drive: Drive, truth_there: Floats, fixes: TruthFixes | None, frame: MapFrame) -> Floats:
    """Where the antenna truly was (n, 2) at a drive's fixes: as stated, else by true pose and declared lever arm."""
    lever_m = np.array([drive.described.antenna_x_m, drive.described.antenna_y_m])
    antenna_m = transform_points(truth_there, lever_m)
    if fixes is None:
        return antenna_m
    stated_m = map_points_from_wgs84(fixes.lat_deg, fixes.lon_deg, frame)
    numbers = {stamp: index for index, stamp in enumerate(fixes.stamp_ns.tolist())}
    known = np.array([numbers.get(stamp, -1) for stamp in drive.fixes.stamp_ns.tolist()])
    antenna_m[known >= 0] = stated_m[known[known >= 0]]
    return antenna_m


def _evaluation(vehicle: str, errors: Sequence[_Errors]) -> PathTruthEvaluation:
    def joined(name: str) -> Floats:
        return np.concatenate([np.zeros(0), *(getattr(one, name) for one in errors)])

    heading = joined("heading_rad")
    heading = heading[np.isfinite(heading)]
    return PathTruthEvaluation(
        vehicle=vehicle,
        error_m=summary_of(joined("path_m")),
        heading_rmse_rad=float(np.sqrt(np.mean(heading**2))) if len(heading) else float("nan"),
        raw_fix_error_m=summary_of(joined("raw_m")),
        error_at_fixes_m=summary_of(joined("at_fixes_m")),
    )
