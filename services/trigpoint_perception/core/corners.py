"""Building corners of one sweep: where two walls end together at a wide angle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint_perception.core.walls import Walls
from trigpoint_perception.settings import WallSettings

Floats = NDArray[np.float64]

SAME_CORNER_M = 0.6  # two pairs of walls whose corners are nearer than this share one


@dataclass(frozen=True, slots=True, kw_only=True)
class PerceivedCorner:
    """A building's corner in the base frame (2,) with covariance (2, 2) in m^2; the lower wall's top above ground, and
    the points on both walls."""

    position_m: Floats
    covariance_m2: Floats
    top_m: float
    points: int


def perceived_corners(walls: Walls, settings: WallSettings) -> tuple[PerceivedCorner, ...]:
    """Corners of walls that meet at 60 to 120 degrees within reach of an end of both, the surest of each place."""
    pairs = zip(*_meeting(walls, settings), strict=True)
    corners = [_corner(walls, int(one), int(other), settings) for one, other in pairs]
    kept: list[PerceivedCorner] = []
    for corner in sorted(corners, key=lambda each: float(np.trace(each.covariance_m2))):
        if all(np.hypot(*(corner.position_m - other.position_m)) > SAME_CORNER_M for other in kept):
            kept.append(corner)
    return tuple(kept)


def _meeting(walls: Walls, settings: WallSettings) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The pairs of walls (m,) that make a corner."""
    across = _crossed(walls.direction[:, None], walls.direction[None])
    between_m = walls.middle_m[None] - walls.middle_m[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        along_first_m = _crossed(between_m, walls.direction[None]) / across
        along_second_m = _crossed(between_m, walls.direction[:, None]) / across
    meeting = np.triu(np.abs(across) >= np.sin(settings.angle_min_rad), 1)
    meeting &= _at_ends(along_first_m, walls.begin_m[:, None], walls.end_m[:, None], settings.reach_m)
    meeting &= _at_ends(along_second_m, walls.begin_m[None], walls.end_m[None], settings.reach_m)
    one, other = np.nonzero(meeting)
    return one, other


def _at_ends(along_m: Floats, begin_m: Floats, end_m: Floats, reach_m: float) -> NDArray[np.bool_]:
    return np.minimum(np.abs(along_m - begin_m), np.abs(along_m - end_m)) <= reach_m


def _crossed(first: Floats, second: Floats) -> Floats:
    """The cross products (...) of vectors (..., 2)."""
    crossed: Floats = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    return crossed


def _corner(walls: Walls, one: int, other: int, settings: WallSettings) -> PerceivedCorner:
    first, second = walls.direction[one], walls.direction[other]
    sine = float(_crossed(first, second))
    between_m = walls.middle_m[other] - walls.middle_m[one]
    along_first_m = float(_crossed(between_m, second)) / sine
    along_second_m = float(_crossed(between_m, first)) / sine
    normals = np.array([[-first[1], first[0]], [-second[1], second[0]]])
    variance_m2 = np.array([_variance_m2(walls, one, along_first_m), _variance_m2(walls, other, along_second_m)])
    solved = np.linalg.inv(normals)
    return PerceivedCorner(
        position_m=walls.middle_m[one] + along_first_m * first,
        covariance_m2=solved @ np.diag(variance_m2) @ solved.T + settings.systematic_sigma_m**2 * np.eye(2),
        top_m=float(min(walls.top_m[one], walls.top_m[other])),
        points=int(walls.points[one] + walls.points[other]),
    )


def _variance_m2(walls: Walls, wall: int, along_m: float) -> float:
    """Of the wall's line across, so far along it."""
    return float(walls.offset_sigma_m[wall] ** 2 + (walls.direction_sigma_rad[wall] * along_m) ** 2)
