"""Where a drive that is being followed lies in the map: by its fixes, or by landmarks that others saw before."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import AlignmentRefused
from trigpoint.geodesy.poses import transform_points, wrap_angle_rad
from trigpoint_optimisation.core.alignment import rigid_alignment
from trigpoint_optimisation.core.constellation import Constellation, constellation_match
from trigpoint_optimisation.core.live_leg import Leg
from trigpoint_optimisation.core.live_tracks import Track
from trigpoint_optimisation.core.trajectory import composed

Floats = NDArray[np.float64]

WINDOW_M = 120.0  # of path: dead reckoning keeps its shape over so much
TRIED_EVERY_M = 15.0  # of path
FRESH_TRACKS = 4  # that a second match needs and the first did not have
AGREEMENT_M, AGREEMENT_RAD = 2.0, 0.07  # between two matches, of where the vehicle is
START_SIGMA_M, START_SIGMA_RAD = 5.0, 0.2  # of a place by landmarks: their sightings say it better
FIX_START_SIGMA_M, FIX_START_SIGMA_RAD = 100.0, 1.0  # of a place by fixes: they are in the graph themselves


@dataclass(frozen=True, slots=True, kw_only=True)
class Placed:
    """A drive's keyframe of this number at a pose (3,) of the map, with covariance (3, 3)."""

    keyframe: int
    pose: Floats
    covariance: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalFix:
    """A fix (2,) in the map of an antenna at (2,) in the frame of a keyframe."""

    keyframe: int
    fix_m: Floats
    antenna_m: Floats


def local_path(legs: Sequence[Leg]) -> dict[int, Floats]:
    """Poses (3,) of the keyframes of consecutive legs, the first at the origin."""
    at = np.zeros(3)
    path = {legs[0].keyframe: at}
    for leg in legs:
        at = composed(at[None, :], leg.delta[None, :])[0]
        path[leg.keyframe + 1] = at
    return path


def start_covariance(sigma_m: float, sigma_rad: float) -> Floats:
    """Covariance (3, 3) of a first guess."""
    return np.diag(np.array([sigma_m, sigma_m, sigma_rad]) ** 2)


def placed_by_fixes(legs: Sequence[Leg], fixes: Sequence[LocalFix], *, sigma_m: float) -> Placed | None:
    """The drive's first keyframe where its fixes bring it; None where they do not fix place and heading."""
    path = local_path(legs)
    known = [fix for fix in fixes if fix.keyframe in path]
    if not known:
        return None
    local = np.array([transform_points(path[fix.keyframe], fix.antenna_m) for fix in known])
    try:
        found = rigid_alignment(local, np.array([fix.fix_m for fix in known]), sigma_m=sigma_m).T_map_path
    except AlignmentRefused:
        return None
    pose = np.array([found.x_m, found.y_m, found.heading_rad])
    covariance = start_covariance(FIX_START_SIGMA_M, FIX_START_SIGMA_RAD)
    return Placed(keyframe=legs[0].keyframe, pose=pose, covariance=covariance)


@dataclass(frozen=True, slots=True)
class _Found:
    T_map_odom: Floats
    tracks: frozenset[int]


class LandmarkPlacing:
    """Finds a drive's place by the landmarks it sees: two matches, of which the second knows more, must agree."""

    def __init__(self) -> None:
        self._tried_m = -math.inf
        self._found: _Found | None = None

    def take(self, legs: Sequence[Leg], tracks: Sequence[Track], known: Constellation) -> Placed | None:
        """The first keyframe of the newest stretch in the map, once its place is sure."""
        if legs[-1].path_m < self._tried_m + TRIED_EVERY_M:
            return None
        self._tried_m = legs[-1].path_m
        stretch = [leg for leg in legs if leg.path_m > legs[-1].path_m - WINDOW_M]
        path = local_path(stretch)
        seen = {track.number: point for track in tracks if (point := _local_point(track, path)) is not None}
        kinds = {track.number: track.kind for track in tracks}
        local = Constellation(
            point_m=np.array(list(seen.values())).reshape(-1, 2), kind=tuple(kinds[number] for number in seen)
        )
        match = constellation_match(local, known)
        if match is None:
            return None
        return self._judged(stretch, match.T_map_local, frozenset(list(seen)[int(a)] for a in match.pairs[:, 0]))

    def _judged(self, stretch: Sequence[Leg], T_map_local: Floats, matched: frozenset[int]) -> Placed | None:
        first = stretch[0]
        T_odom = first.T_odom_start
        T_map_odom = composed(T_map_local[None, :], _inverse(T_odom)[None, :])[0]
        before = self._found
        if before is None or not _agree(before.T_map_odom, T_map_odom, stretch[-1].T_odom_end):
            self._found = _Found(T_map_odom, matched)
            return None
        if len(matched - before.tracks) < FRESH_TRACKS:
            return None
        covariance = start_covariance(START_SIGMA_M, START_SIGMA_RAD)
        return Placed(keyframe=first.keyframe, pose=T_map_local, covariance=covariance)


def _local_point(track: Track, path: dict[int, Floats]) -> Floats | None:
    points = [transform_points(path[each.keyframe], each.point_m) for each in track.seen if each.keyframe in path]
    mean: Floats | None = np.mean(points, axis=0) if points else None
    return mean


def _inverse(pose: Floats) -> Floats:
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return np.array([-c * pose[0] - s * pose[1], s * pose[0] - c * pose[1], -pose[2]])


def map_from_odom(T_map_base: Floats, T_odom_base: Floats) -> Floats:
    """T_map_odom (3,) from the base's pose in both."""
    found: Floats = composed(T_map_base[None, :], _inverse(T_odom_base)[None, :])[0]
    found[2] = wrap_angle_rad(float(found[2]))
    return found


def _agree(one: Floats, other: Floats, T_odom_base: Floats) -> bool:
    """Whether two frames bring the vehicle to the same place."""
    a, b = (composed(each[None, :], T_odom_base[None, :])[0] for each in (one, other))
    near = math.hypot(*(a - b)[:2]) <= AGREEMENT_M
    return near and abs(wrap_angle_rad(float(a[2] - b[2]))) <= AGREEMENT_RAD
