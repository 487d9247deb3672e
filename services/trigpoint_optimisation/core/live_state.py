"""What a live map knows of each drive in it."""

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.observed import VehicleDescribed
from trigpoint_optimisation.core.live_leg import HungFix, Leg
from trigpoint_optimisation.core.live_placing import LandmarkPlacing, LocalFix
from trigpoint_optimisation.core.live_tracks import Track

Floats = NDArray[np.float64]
DriveName = tuple[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivePlace:
    """Where a drive is: its newest keyframe's stamp, T_map_base and T_map_odom (3,), the base's covariance (3, 3)."""

    vehicle: str
    boot_id: str
    stamp_ns: int
    T_map_base: Floats
    T_map_odom: Floats
    covariance: Floats


@dataclass(slots=True)
class DriveInMap:
    """One drive's part in the map. `waiting`: legs that have no place yet; `unseen`: legs in the graph whose tracks are
    to be looked at yet; `of`: the landmark of each track; `own`: the key of the pass's point of each track that has
    one."""

    index: int
    described: VehicleDescribed
    boot_id: str
    waiting: list[Leg] = field(default_factory=list)
    unseen: deque[Leg] = field(default_factory=deque)
    fixes: dict[int, LocalFix] = field(default_factory=dict)
    hung: dict[int, tuple[int, HungFix]] = field(default_factory=dict)
    pending: dict[int, Track] = field(default_factory=dict)
    of: dict[int, int] = field(default_factory=dict)
    own: dict[int, int] = field(default_factory=dict)
    strikes: dict[int, int] = field(default_factory=dict)
    pending_since_m: dict[int, float] = field(default_factory=dict)
    placing: LandmarkPlacing = field(default_factory=LandmarkPlacing)
    placed: bool = False
    first_keyframe: int = 0
    newest: Leg | None = None
    knot: int = -1
    knot_ns: int = 0
    last_fix_keyframe: int = -1
    last_fix_ns: int = 0
    voted_m: float = -1e9


def into_frame(T_a_b: Floats, point_a_m: Floats) -> Floats:
    """A point (2,) of frame a in frame b."""
    c, s = np.cos(T_a_b[2]), np.sin(T_a_b[2])
    turned: Floats = np.array([[c, s], [-s, c]]) @ (point_a_m - T_a_b[:2])
    return turned
