"""A drive's solved path at any time between its poses."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.compiled import compiled
from trigpoint.events.mapped import TrajectorySolved

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
        found = np.empty((len(stamp_ns), 3))
        _on_arcs(self.stamp_ns, self.pose, np.searchsorted(self.stamp_ns, stamp_ns, side="right"), stamp_ns, found)
        return found

    def covariance_at(self, stamp_ns: int) -> Floats:
        """The covariance (3, 3) of the pose nearest in time."""
        after = int(np.clip(np.searchsorted(self.stamp_ns, stamp_ns), 1, len(self.stamp_ns) - 1))
        nearer = after - 1 if stamp_ns - self.stamp_ns[after - 1] < self.stamp_ns[after] - stamp_ns else after
        return np.asarray(self.covariance[nearer])


def path_of(solved: TrajectorySolved) -> DrivenPath:
    """A solved trajectory as a path: poses of one time but the first are left out."""
    _, first = np.unique(solved.stamp_ns, return_index=True)
    return DrivenPath(stamp_ns=solved.stamp_ns[first], pose=solved.pose[first], covariance=solved.covariance[first])


@compiled
def _on_arcs(path_ns: Ints, pose: Floats, after: Ints, stamp_ns: Ints, found: Floats) -> None:
    """Fills in poses at times, each before the pose of the path at `after`."""
    for one in range(len(stamp_ns)):
        begin = min(max(after[one] - 1, 0), len(path_ns) - 2)
        end = begin + 1
        share = (stamp_ns[one] - path_ns[begin]) / (path_ns[end] - path_ns[begin])
        turn_rad = (pose[end, 2] - pose[begin, 2] + math.pi) % (2.0 * math.pi) - math.pi
        x_m, y_m = pose[end, 0] - pose[begin, 0], pose[end, 1] - pose[begin, 1]
        back_rad = -0.5 * (1.0 - share) * turn_rad
        part, c, s = _arc_share(share, turn_rad), math.cos(back_rad), math.sin(back_rad)
        found[one, 0] = pose[begin, 0] + part * (c * x_m - s * y_m)
        found[one, 1] = pose[begin, 1] + part * (s * x_m + c * y_m)
        found[one, 2] = pose[begin, 2] + share * turn_rad


@compiled
def _arc_share(share: float, turn_rad: float) -> float:
    """The chord of a share of an arc over the whole chord: sin(share turn/2) / sin(turn/2)."""
    if abs(turn_rad) < STRAIGHT_RAD:
        return share
    return math.sin(0.5 * share * turn_rad) / math.sin(0.5 * turn_rad)
