"""Drives solved for by wheels, gyroscope, lidar odometry, fixes and loops alone: what the loops do for them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from looped_worlds.examples import spoiled
from looped_worlds.judging import TruePaths
from trigpoint.events.drives import NO_DETECTIONS, Drive, LoopSeries
from trigpoint.geodesy.projection import MapFrame
from trigpoint_optimisation.core.odometry import relative_poses
from trigpoint_optimisation.core.stages import Solved, solve_fleet
from trigpoint_optimisation.core.trajectory import poses_at
from trigpoint_optimisation.settings import LoopSettings, SolveSettings

Floats = NDArray[np.float64]

SPOILED_SEED = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Solve:
    """Mean error of the paths, and mean error of where one base was as seen from the other at loops that took no part,
    in m."""

    path_m: float
    apart_m: float


def solve_without_landmarks(
    drives: Sequence[Drive], frame: MapFrame, truth_file: Path, *, with_loops: bool, wrong_share: float = 0.0
) -> Solve:
    """The drives without landmarks, with every second of their loops, of which a share is made wrong, or with none."""
    rng = np.random.default_rng(SPOILED_SEED)
    bare = [
        replace(drive, detections=NO_DETECTIONS, loops=spoiled(_every_second(drive.loops, 0), wrong_share, rng))
        for drive in drives
    ]
    solved = solve_fleet(bare, [], frame, SolveSettings(method="loose", loops=LoopSettings(used=with_loops)))
    truth = TruePaths(truth_file, frame)
    path_m = [
        np.hypot(*(state.pose - truth.at(each.drive.vehicle, each.stamp_ns))[:, :2].T)
        for each, state in zip(solved.fleet.prepared, solved.state.drives, strict=True)
    ]
    return Solve(path_m=float(np.concatenate(path_m).mean()), apart_m=_apart_m(drives, solved, truth))


def _every_second(loops: LoopSeries, first: int) -> LoopSeries:
    rows = np.arange(first, len(loops.other), 2)
    return LoopSeries(other=tuple(loops.other[row] for row in rows), motions=loops.motions.chosen(rows))


def _apart_m(drives: Sequence[Drive], solved: Solved, truth: TruePaths) -> float:
    found = {
        (each.drive.vehicle, each.drive.boot_id): (each, state.pose)
        for each, state in zip(solved.fleet.prepared, solved.state.drives, strict=True)
    }
    errors = []
    for drive in drives:
        withheld = _every_second(drive.loops, 1)
        for row, other in enumerate(withheld.other):
            from_ns, to_ns = withheld.motions.from_stamp_ns[[row]], withheld.motions.stamp_ns[[row]]
            there = poses_at(*found[other], from_ns)
            here = poses_at(*found[drive.vehicle, drive.boot_id], to_ns)
            true = relative_poses(truth.at(other[0], from_ns), truth.at(drive.vehicle, to_ns))
            errors.append(np.hypot(*(relative_poses(there, here) - true)[0, :2]))
    return float(np.mean(errors))
