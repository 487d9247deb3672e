"""A drive's solved path at any time between its poses."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.mapped import TrajectorySolved
from trigpoint.geodesy.poses import transform_points, wrap_angles_rad

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

GAP_MOST_NS = 2_000_000_000  # between two poses; what lies in a longer gap has no place
STRAIGHT_RAD = 1e-6  # below, a turn's arc is its chord


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivenPath:
    """stamp_ns (n,) ascending; pose (n, 3): x, y in m, heading in rad, base in map; covariance (n, 3, 3)."""

    stamp_ns: Ints
    pose: Floats
    covariance: Floats

    def holds(self, first_ns: int, last_ns: int) -> bool:
        """Whether all the time between two moments has poses around it, near enough."""
        if len(self.stamp_ns) < 2 or first_ns < self.stamp_ns[0] or last_ns > self.stamp_ns[-1]:
            return False
        begin = int(np.searchsorted(self.stamp_ns, first_ns, side="right")) - 1
        end = int(np.searchsorted(self.stamp_ns, last_ns, side="left"))
        return bool(np.diff(self.stamp_ns[begin : end + 1]).max(initial=0) <= GAP_MOST_NS)

    def poses_at(self, stamp_ns: Ints) -> Floats:
        """Poses (m, 3) at times (m,) the path holds: on the arc of constant speed and turn from pose to pose (the
        exponential map of SE(2))."""
        before = np.clip(np.searchsorted(self.stamp_ns, stamp_ns, side="right") - 1, 0, len(self.stamp_ns) - 2)
        start, end = self.pose[before], self.pose[before + 1]
        span_ns = self.stamp_ns[before + 1] - self.stamp_ns[before]
        share = (stamp_ns - self.stamp_ns[before]) / span_ns
        turn_rad = wrap_angles_rad(end[:, 2] - start[:, 2])
        chord_m = end[:, :2] - start[:, :2]
        part_m = _arc_share(share, turn_rad)[:, None] * _rotated(chord_m, -0.5 * (1.0 - share) * turn_rad)
        return np.column_stack([start[:, :2] + part_m, start[:, 2] + share * turn_rad])

    def covariance_at(self, stamp_ns: int) -> Floats:
        """The covariance (3, 3) of the pose nearest in time."""
        after = int(np.clip(np.searchsorted(self.stamp_ns, stamp_ns), 1, len(self.stamp_ns) - 1))
        nearer = after - 1 if stamp_ns - self.stamp_ns[after - 1] < self.stamp_ns[after] - stamp_ns else after
        return np.asarray(self.covariance[nearer])


def path_of(solved: TrajectorySolved) -> DrivenPath:
    """A solved trajectory as a path: poses of one time but the first are left out."""
    _, first = np.unique(solved.stamp_ns, return_index=True)
    return DrivenPath(stamp_ns=solved.stamp_ns[first], pose=solved.pose[first], covariance=solved.covariance[first])


def _arc_share(share: Floats, turn_rad: Floats) -> Floats:
    """The chord of a share of an arc over the whole chord: sin(share turn/2) / sin(turn/2)."""
    straight = np.abs(turn_rad) < STRAIGHT_RAD
    half = np.where(straight, 1.0, 0.5 * turn_rad)
    return np.asarray(np.where(straight, share, np.sin(share * half) / np.sin(half)))


def _rotated(vector_m: Floats, angle_rad: Floats) -> Floats:
    nowhere = np.zeros_like(angle_rad)
    return transform_points(np.column_stack([nowhere, nowhere, angle_rad]), vector_m)
