"""The legs a drive has just made, for what is found in their sweeps later."""

from bisect import bisect_right
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint_optimisation.core.live_leg import Leg
from trigpoint_optimisation.core.odometry import DeadReckonedPath, relative_poses

Floats = NDArray[np.float64]

LATE_LEGS = 600  # kept, some 1.2 km: a kilobyte each


@dataclass(slots=True)
class LateLeg:
    """A leg of which something was seen after it was whole: in how many sweeps."""

    leg: Leg
    sweeps: int = 0


class PastLegs:
    """The newest legs with their paths; older ones are forgotten."""

    def __init__(self) -> None:
        self._legs: deque[tuple[Leg, DeadReckonedPath]] = deque(maxlen=LATE_LEGS)
        self._under_way: LateLeg | None = None
        self._seen: list[LateLeg] = []

    def add(self, leg: Leg, path: DeadReckonedPath) -> None:
        """The next leg; `path` begins at its keyframe."""
        self._legs.append((leg, path))

    def at(self, stamp_ns: int) -> tuple[Leg, Floats] | None:
        """The leg a stamp lies in, with T_keyframe_base (3,) there; None where it is older than what is kept."""
        row = bisect_right(self._legs, stamp_ns, key=lambda each: each[0].start_ns) - 1
        if row < 0 or stamp_ns >= self._legs[row][0].end_ns:
            return None
        leg, path = self._legs[row]
        return leg, offset_at(path, stamp_ns)

    def see(self, leg: Leg) -> None:
        """One more sweep of a leg was taken in."""
        if self._under_way is None or self._under_way.leg is not leg:
            self.leave()
            self._under_way = LateLeg(leg)
        self._under_way.sweeps += 1

    def leave(self) -> None:
        """The next sweep is of another leg."""
        if self._under_way is not None:
            self._seen.append(self._under_way)
            self._under_way = None

    def take_seen(self) -> list[LateLeg]:
        """The legs of which more was seen, each once that is whole, and once."""
        seen, self._seen = self._seen, []
        return seen


def offset_at(path: DeadReckonedPath, stamp_ns: int) -> Floats:
    """The base's pose (3,) at a stamp in the frame of the path's first keyframe."""
    at = path.at(np.array([path.stamp_ns[0], stamp_ns]))
    offset: Floats = relative_poses(at[:1], at[1:])[0]
    return offset
