"""What one drive did from one keyframe to the next."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint_optimisation.core.live_tracks import Track

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class HungFix:
    """A fix: the base's pose (3,) at its time in its keyframe's frame."""

    sequence: int
    stamp_ns: int
    lat_deg: float
    lon_deg: float
    T_keyframe_base: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Leg:
    """What one drive did from keyframe `keyframe` to the next, and what it saw on the way, hung on the first: tracks by
    number, to which come those that were perceived later.

    T_odom_start and T_odom_end (3,): by nominal dead reckoning; `delta` (3,) and `covariance` (3, 3) by the
    calibration learned so far.
    """

    keyframe: int
    start_ns: int
    end_ns: int
    T_odom_start: Floats
    T_odom_end: Floats
    delta: Floats
    covariance: Floats
    path_m: float
    tracks: dict[int, Track]
    fixes: tuple[HungFix, ...]
