"""How noisy a drive's fixes are, told by the fixes themselves against the path they fit."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.geodesy.poses import transform_points
from trigpoint_optimisation.core.preparation import PreparedDrive
from trigpoint_optimisation.core.robust_scale import robust_sigma
from trigpoint_optimisation.core.state import DriveState
from trigpoint_optimisation.settings import FixSettings

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

WHITE_MOST_M = 5.0
WHITE_LEAST_SHARE = 0.5  # of the slow sigma: a slow error that slides faster than the model must not bend the path
SLOW_MOST_M = 8.0
NEIGHBOUR_S = 2.5  # two fixes this close in time share their slow error
MIN_PAIRS = 20
MOVED_M = 0.3  # a standing receiver repeats itself: such pairs say nothing of its noise


def fix_residuals(prepared: PreparedDrive, state: DriveState) -> Floats:
    """Fix minus antenna (f, 2) in m, map frame, at the state's poses."""
    antenna = transform_points(prepared.fix_offset, state.antenna_m)
    residual: Floats = prepared.fix_m - transform_points(state.pose[prepared.fix_keyframe], antenna)
    return residual


def measured_fix_settings(
    prepared: PreparedDrive, state: DriveState, trusted: Bools, fixes: FixSettings
) -> FixSettings:
    """The fix settings with white and slow sigma as the drive's residuals show them.

    White from differences of neighbouring fixes, slow from what the residuals have beyond it, by medians. The fitted
    path follows the slow error and hides most of it, and all of its duration: the slow sigma is never below the given
    one, and the given time stays.
    """
    rows = np.nonzero(trusted)[0]
    residual = fix_residuals(prepared, state)[rows]
    stamp_s = (prepared.drive.fixes.stamp_ns[rows] - prepared.stamp_ns[0]) * 1e-9
    path_m = prepared.fix_path_m[rows]
    near = (np.diff(stamp_s) <= NEIGHBOUR_S) & (np.diff(path_m) > MOVED_M)
    if near.sum() < MIN_PAIRS:
        return fixes
    white = robust_sigma(np.diff(residual, axis=0)[near]) / np.sqrt(2.0)
    total = robust_sigma(residual)
    slow_m = float(np.clip(np.sqrt(max(total**2 - white**2, 0.0)), fixes.bias_sigma_m, SLOW_MOST_M))
    return replace(
        fixes,
        sigma_m=float(np.clip(white, WHITE_LEAST_SHARE * slow_m, WHITE_MOST_M)),
        bias_sigma_m=slow_m,
    )
