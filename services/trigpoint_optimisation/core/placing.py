"""First places for a drive's keyframes: by its fixes where it has them."""

import numpy as np
from numpy.typing import NDArray

from trigpoint.geodesy.poses import transform_points, wrap_angles_rad
from trigpoint_optimisation.core.alignment import bent_alignment, turned_path
from trigpoint_optimisation.core.chordal import chordal_poses
from trigpoint_optimisation.core.odometry import TurnSource, relative_poses
from trigpoint_optimisation.core.preparation import PreparedDrive

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

LINEAR_SIGMA_M = 15.0  # of one fix in the linear solve: fixes a second apart share their error
LINEAR_CAUCHY_M = 4.5  # beyond this a fix counts ever less in the linear solve
LINEAR_GATE_M = 12.0  # from the linear solve's path: a fix beyond it does not agree
CALIBRATION_INFORMATION = (1e2, 1e2, 1e2, 1e3)  # of speed scale, turn scale, delay (1/s^2), turn bias: weak priors
FIX_SIGMA_M = 2.0  # scale at which a fix's disagreement with the bent path begins to count less


def placed_by_fixes(
    prepared: PreparedDrive, allowed: Bools, *, point_scale: float, solved: Floats | None = None
) -> tuple[Floats, Bools]:
    """Keyframe poses (n, 3) in the map by the allowed fixes (f,), and which fixes agree with the path.

    Two ways that need no first guess, and the one the odometry and the fixes contradict less: the path bent to its
    fixes, good where odometry is sure over tens of metres; and the linear chordal solve, good where it is not.
    `solved` (n, 3), if given, are poses of an earlier solve that stand beside the two.
    Where the wheels were only sampled the plain linear solve alone, and every fix agrees: a long excursion of the
    receiver looks like odometry's error until the calibration is known, and whoever is left out then stays out.
    Raises AlignmentRefused when the fixes do not determine the path.
    """
    pose, consistent = _bent(prepared, allowed, point_scale=point_scale)
    usable = allowed & prepared.fix_usable
    if prepared.source is TurnSource.SAMPLED_WHEELS:
        plain = _chordal(prepared, usable, point_scale=point_scale, cauchy_m=None)
        return plain if solved is None else solved, usable
    linear = _chordal(prepared, usable, point_scale=point_scale, cauchy_m=LINEAR_CAUCHY_M)
    others = [linear] if solved is None else [linear, solved]
    best = min(others, key=lambda other: _contradiction(prepared, other, usable, point_scale))
    if _contradiction(prepared, best, usable, point_scale) < _contradiction(prepared, pose, usable, point_scale):
        off_m = np.hypot(*(prepared.fix_m - _antennas(prepared, best, point_scale)).T)
        return best, usable & (off_m <= LINEAR_GATE_M)
    return pose, consistent


def _arms(prepared: PreparedDrive, point_scale: float) -> Floats:
    """The nominal antenna (f, 2) at each fix in its keyframe's frame, m."""
    return transform_points(prepared.fix_offset, prepared.nominal_antenna_m(point_scale))


def _antennas(prepared: PreparedDrive, pose: Floats, point_scale: float) -> Floats:
    """The antenna (f, 2) in the map at each fix, as keyframe poses (n, 3) place it."""
    return transform_points(pose[prepared.fix_keyframe], _arms(prepared, point_scale))


def _chordal(prepared: PreparedDrive, usable: Bools, *, point_scale: float, cauchy_m: float | None) -> Floats:
    arm = _arms(prepared, point_scale)
    return chordal_poses(
        prepared.motions,
        prepared.fix_m[usable],
        arm[usable],
        prepared.fix_keyframe[usable],
        sigma_m=LINEAR_SIGMA_M,
        cauchy_m=cauchy_m,
    )


def _contradiction(prepared: PreparedDrive, pose: Floats, usable: Bools, point_scale: float) -> float:
    """How much poses (n, 3) contradict odometry and usable fixes: their cost in sigmas squared, fixes under Cauchy,
    odometry at the calibration that suits the poses best."""
    motions = prepared.motions
    residual = relative_poses(pose[:-1], pose[1:]) - motions.delta
    residual[:, 2] = wrap_angles_rad(residual[:, 2])
    information = np.linalg.inv(motions.covariance)
    weighted = np.einsum("nki,nkl->nil", motions.derivative, information)
    normal = np.einsum("nil,nlj->ij", weighted, motions.derivative) + np.diag(CALIBRATION_INFORMATION)
    change = np.linalg.solve(normal, np.einsum("nil,nl->i", weighted, residual))
    residual -= motions.derivative @ change
    by_odometry = np.einsum("ni,nij,nj->", residual, information, residual)
    off_m = np.hypot(*(prepared.fix_m - _antennas(prepared, pose, point_scale))[usable].T)
    by_fixes = (LINEAR_CAUCHY_M / LINEAR_SIGMA_M) ** 2 * np.log1p((off_m / LINEAR_CAUCHY_M) ** 2).sum()
    return float(by_odometry + by_fixes)


def _bent(prepared: PreparedDrive, allowed: Bools, *, point_scale: float) -> tuple[Floats, Bools]:
    """Keyframe poses (n, 3) bent to the allowed fixes (f,), and which fixes agree with one another."""
    rows = np.nonzero(allowed & prepared.fix_usable)[0]
    path, arm_m = prepared.motions.path, prepared.nominal_antenna_m(point_scale)
    fix_ns = prepared.drive.fixes.stamp_ns[rows]
    bent = bent_alignment(
        path.at(fix_ns), arm_m, prepared.fix_m[rows], path_m=prepared.fix_path_m[rows], sigma_m=FIX_SIGMA_M
    )
    start_ns = prepared.stamp_ns[0]
    fix_s, keyframe_s = (fix_ns - start_ns) * 1e-9, (prepared.stamp_ns - start_ns) * 1e-9
    turn = np.interp(keyframe_s, fix_s, bent.heading_correction_rad)
    pose = turned_path(path.at(prepared.stamp_ns), turn)
    at_fixes = np.column_stack([np.interp(fix_s, keyframe_s, pose[:, axis]) for axis in (0, 1)])
    shift = bent.pose[:, :2] - at_fixes
    pose[:, :2] += np.column_stack([np.interp(keyframe_s, fix_s, shift[:, axis]) for axis in (0, 1)])
    pose[:, 2] = wrap_angles_rad(pose[:, 2])
    consistent = np.zeros(len(allowed), dtype=bool)
    consistent[rows] = bent.consistent
    return pose, consistent
