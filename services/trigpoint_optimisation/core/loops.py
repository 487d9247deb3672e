"""Closed loops in the graph: robust, since a wrong one must not bend the map."""

from collections.abc import Sequence
from dataclasses import replace

import gtsam
import numpy as np

from trigpoint_optimisation.core.preparation import PreparedDrive
from trigpoint_optimisation.core.relative_poses import RelativePoses, add_relative_poses, hung_motions
from trigpoint_optimisation.settings import LoopSettings


def loop_poses(prepared: Sequence[PreparedDrive], *, point_scale: float) -> list[RelativePoses]:
    """The loops of every drive with itself and each other one; those with a drive that is not there are left out."""
    named = {(each.drive.vehicle, each.drive.boot_id): each for each in prepared}
    found = []
    for each in prepared:
        loops = each.drive.loops
        for other in dict.fromkeys(loops.other):
            rows = np.array([name == other for name in loops.other], dtype=bool)
            if other in named:
                found.append(hung_motions(named[other], each, loops.motions.chosen(rows), point_scale=point_scale))
    return found


def add_loops(
    graph: gtsam.NonlinearFactorGraph,
    prepared: Sequence[PreparedDrive],
    settings: LoopSettings,
    *,
    point_scale: float,
    wide_m: float = 0.0,
) -> None:
    """Every loop as a factor; `wide_m` adds so much to its sigmas, under the wider kernel."""
    if not settings.used:
        return
    kernel = settings.widened_kernel if wide_m else settings.kernel
    added = np.diag([wide_m**2, wide_m**2, (settings.widened_rad_per_m * wide_m) ** 2])
    for relative in loop_poses(prepared, point_scale=point_scale):
        add_relative_poses(graph, replace(relative, covariance=relative.covariance + added), kernel=kernel)
