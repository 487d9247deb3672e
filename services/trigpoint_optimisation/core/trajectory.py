"""A drive's path between its keyframes."""

import numpy as np
from numpy.typing import NDArray

from trigpoint.geodesy.poses import transform_points, wrap_angles_rad
from trigpoint_optimisation.core.odometry import relative_poses
from trigpoint_optimisation.core.preparation import PreparedDrive

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def composed(T_a_b: Floats, T_b_c: Floats) -> Floats:
    """Poses (n, 3) T_a_c."""
    return np.column_stack([transform_points(T_a_b, T_b_c[:, :2]), T_a_b[:, 2] + T_b_c[:, 2]])


def poses_at(prepared: PreparedDrive, pose: Floats, stamp_ns: Ints) -> Floats:
    """Base poses (m, 3) in the map at any stamps (m,): dead reckoning from the keyframe before and the one after,
    blended along the path. pose (n, 3): the keyframes' poses. A standing vehicle stands here too.
    """
    path, keyframe_ns = prepared.motions.path, prepared.stamp_ns
    before = np.clip(np.searchsorted(keyframe_ns, stamp_ns, side="right") - 1, 0, len(keyframe_ns) - 1)
    after = np.minimum(before + 1, len(keyframe_ns) - 1)
    here, start, end = path.at(stamp_ns), path.at(keyframe_ns[before]), path.at(keyframe_ns[after])
    from_before = composed(pose[before], relative_poses(start, here))
    from_after = composed(pose[after], relative_poses(end, here))
    span_ns = np.maximum(keyframe_ns[after] - keyframe_ns[before], 1)
    by_time = np.clip((stamp_ns - keyframe_ns[before]) / span_ns, 0.0, 1.0)
    moved = np.hypot(*(here - start)[:, :2].T) + np.hypot(*(end - here)[:, :2].T)
    share = np.where(moved > 1e-3, np.hypot(*(here - start)[:, :2].T) / np.maximum(moved, 1e-3), by_time)[:, None]
    turn = wrap_angles_rad(from_after - from_before)[:, 2:]
    step = np.column_stack([(from_after - from_before)[:, :2], turn])
    blended: Floats = from_before + share * step
    blended[:, 2] = wrap_angles_rad(blended[:, 2])
    return blended


def output_stamps(prepared: PreparedDrive, *, step_s: float) -> Ints:
    """Keyframes and every `step_s` between them, sorted."""
    grid = np.arange(prepared.stamp_ns[0], prepared.stamp_ns[-1], round(step_s * 1e9), dtype=np.int64)
    return np.unique(np.concatenate([prepared.stamp_ns, grid]))
