"""First places for a drive's keyframes: by its fixes where it has them."""

import numpy as np
from numpy.typing import NDArray

from trigpoint.geodesy.poses import wrap_angles_rad
from trigpoint_optimisation.core.alignment import bent_alignment, turned_path
from trigpoint_optimisation.core.preparation import PreparedDrive

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

FIX_SIGMA_M = 2.0  # scale at which a fix's disagreement with the bent path begins to count less


def placed_by_fixes(prepared: PreparedDrive, allowed: Bools, *, point_scale: float) -> tuple[Floats, Bools]:
    """Keyframe poses (n, 3) in the map, bent to the allowed fixes (f,), and which fixes agree with one another.

    Raises AlignmentRefused when the fixes do not determine the path.
    """
    rows = np.nonzero(allowed & prepared.fix_usable)[0]
    described, path = prepared.drive.described, prepared.motions.path
    arm = point_scale * np.array([described.antenna_x_m, described.antenna_y_m])
    fix_ns = prepared.drive.fixes.stamp_ns[rows]
    bent = bent_alignment(
        path.at(fix_ns), arm, prepared.fix_m[rows], path_m=prepared.fix_path_m[rows], sigma_m=FIX_SIGMA_M
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
