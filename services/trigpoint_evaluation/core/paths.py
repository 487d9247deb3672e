"""Poses between the keyframes of a path, its antenna and its length."""

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.mapped import TrajectorySolved
from trigpoint.geodesy.poses import transform_points, wrap_angles_rad

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SMALL_ANGLE_RAD = 1e-6  # below this a turn's arc and chord differ by less than 1e-13 of their length
NS_PER_S = 1e9


def poses_at(stamp_ns: Ints, pose: Floats, *, at_ns: Ints, gap_limit_s: float = float("inf")) -> Floats:
    """Poses (q, 3) at instants (q,): between two keyframes along the circular arc that joins them.

    stamp_ns (n,) rising and pose (n, 3): x, y in m, heading in rad. NaN outside the path's time and in gaps
    between keyframes longer than `gap_limit_s`.
    """
    found = np.full((len(at_ns), 3), np.nan)
    if len(stamp_ns) == 0:
        return found
    after = np.clip(np.searchsorted(stamp_ns, at_ns, side="left"), 1, max(len(stamp_ns) - 1, 1))
    before = np.minimum(after - 1, len(stamp_ns) - 1)
    after = np.minimum(after, len(stamp_ns) - 1)
    span_ns = stamp_ns[after] - stamp_ns[before]
    inside = (at_ns >= stamp_ns[0]) & (at_ns <= stamp_ns[-1])
    exact = (at_ns == stamp_ns[before]) | (at_ns == stamp_ns[after])
    inside &= exact | (span_ns <= gap_limit_s * NS_PER_S)
    share = (at_ns - stamp_ns[before])[inside] / np.maximum(span_ns[inside], 1)
    found[inside] = _along_arc(pose[before[inside]], pose[after[inside]], share)
    return found


def _along_arc(start: Floats, end: Floats, share: Floats) -> Floats:
    """Poses (q, 3) a share (q,) of the way from start to end (q, 3): exp(share log(start^-1 end)) on SE(2)."""
    c, s = np.cos(start[:, 2]), np.sin(start[:, 2])
    dx_m, dy_m = end[:, 0] - start[:, 0], end[:, 1] - start[:, 1]
    turn_rad = wrap_angles_rad(end[:, 2] - start[:, 2])
    forward_m, left_m = c * dx_m + s * dy_m, -s * dx_m + c * dy_m
    half = 0.5 * turn_rad
    cotangent = np.where(np.abs(half) < SMALL_ANGLE_RAD, 1.0, half / np.tan(np.where(half == 0.0, 1.0, half)))
    twist_x, twist_y = cotangent * forward_m + half * left_m, -half * forward_m + cotangent * left_m
    angle = share * turn_rad
    small = np.abs(angle) < SMALL_ANGLE_RAD
    safe = np.where(small, 1.0, angle)
    sine = np.where(small, 1.0, np.sin(safe) / safe)
    cosine = np.where(small, 0.5 * angle, (1.0 - np.cos(safe)) / safe)
    step_m = np.column_stack([share * (sine * twist_x - cosine * twist_y), share * (cosine * twist_x + sine * twist_y)])
    return np.column_stack([transform_points(start, step_m), wrap_angles_rad(start[:, 2] + angle)])


def path_length_m(pose: Floats) -> float:
    """Length in m of a path through poses (n, 3)."""
    return float(np.hypot(*np.diff(pose[:, :2], axis=0).T).sum())


def antenna_points_m(trajectory: TrajectorySolved, at_ns: Ints) -> Floats:
    """Where the antenna was (q, 2) in the map frame, by the path and its calibrated lever arm; NaN outside."""
    values = {name: value for name, value, _ in trajectory.calibration}
    lever_m = np.array([values.get("antenna_x_m", 0.0), values.get("antenna_y_m", 0.0)])
    return transform_points(poses_at(trajectory.stamp_ns, trajectory.pose, at_ns=at_ns), lever_m)
