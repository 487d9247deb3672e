"""How noisy a drive's fixes are, told by the fixes themselves against the path they fit."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.geodesy.poses import transform_points
from trigpoint_optimisation.core.preparation import PreparedDrive
from trigpoint_optimisation.core.state import DriveState
from trigpoint_optimisation.settings import FixSettings

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SIGMAS_PER_MAD = 1.4826  # of a normal distribution
WHITE_LIMITS_M = (0.3, 5.0)
SLOW_LIMITS_M = (1.0, 8.0)
SLOW_TIME_LIMITS_S = (15.0, 120.0)
NEIGHBOUR_S = 2.5  # two fixes this close in time share their slow error
LAG_S = 10.0  # at which the slow error's decay is read
MIN_PAIRS = 20
MOVED_M = 0.3  # a standing receiver repeats itself: such pairs say nothing of its noise


def fix_residuals(prepared: PreparedDrive, state: DriveState) -> Floats:
    """Fix minus antenna (f, 2) in m, map frame, at the state's poses."""
    offset = prepared.fix_offset
    antenna = transform_points(offset, np.broadcast_to(state.antenna_m, (len(offset), 2)))
    residual: Floats = prepared.fix_m - transform_points(state.pose[prepared.fix_keyframe], antenna)
    return residual


def measured_fix_settings(
    prepared: PreparedDrive, state: DriveState, trusted: Bools, fixes: FixSettings
) -> FixSettings:
    """The fix settings with white sigma, slow sigma and slow time as the drive's residuals show them.

    White from differences of neighbouring fixes, slow from what the residuals have beyond it, its time from their
    correlation at `LAG_S`, all by medians (Rousseeuw and Croux 1993); within limits, as the fitted path hides part.
    """
    rows = np.nonzero(trusted)[0]
    residual = fix_residuals(prepared, state)[rows]
    stamp_s = (prepared.drive.fixes.stamp_ns[rows] - prepared.stamp_ns[0]) * 1e-9
    path_m = prepared.fix_path_m[rows]
    near = (np.diff(stamp_s) <= NEIGHBOUR_S) & (np.diff(path_m) > MOVED_M)
    if near.sum() < MIN_PAIRS:
        return fixes
    white = _sigma(np.diff(residual, axis=0)[near]) / np.sqrt(2.0)
    total = _sigma(residual)
    slow = np.sqrt(max(total**2 - white**2, 0.0))
    return replace(
        fixes,
        sigma_m=float(np.clip(white, *WHITE_LIMITS_M)),
        bias_sigma_m=float(np.clip(1.5 * slow, *SLOW_LIMITS_M)),
        bias_time_s=_decay_time_s(residual, stamp_s, slow),
    )


def _sigma(values: Floats) -> float:
    return SIGMAS_PER_MAD * float(np.median(np.abs(values)))


def _decay_time_s(residual: Floats, stamp_s: Floats, slow_m: float) -> float:
    """Time constant of the slow error from the spread of differences `LAG_S` apart: 2 slow^2 (1 - exp(-lag / time))."""
    later = np.searchsorted(stamp_s, stamp_s + LAG_S)
    i = np.nonzero(later < len(stamp_s))[0]
    close = stamp_s[later[i]] - stamp_s[i] < LAG_S + NEIGHBOUR_S
    i = i[close]
    if len(i) < MIN_PAIRS or slow_m <= 0.0:
        return SLOW_TIME_LIMITS_S[1]
    spread = _sigma(residual[later[i]] - residual[i])
    kept = 1.0 - min(spread**2 / (2.0 * slow_m**2), 0.999)
    if kept <= 0.0:
        return SLOW_TIME_LIMITS_S[0]
    return float(np.clip(-LAG_S / np.log(kept), *SLOW_TIME_LIMITS_S))
