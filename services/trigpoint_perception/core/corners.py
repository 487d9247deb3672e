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
    count = len(walls.top_m)
    corners = [
        corner
        for one in range(count)
        for other in range(one + 1, count)
        if (corner := _corner(walls, one, other, settings)) is not None
    ]
    kept: list[PerceivedCorner] = []
    for corner in sorted(corners, key=lambda each: float(np.trace(each.covariance_m2))):
        if all(np.hypot(*(corner.position_m - other.position_m)) > SAME_CORNER_M for other in kept):
            kept.append(corner)
    return tuple(kept)


def _corner(walls: Walls, one: int, other: int, settings: WallSettings) -> PerceivedCorner | None:
    first, second = walls.direction[one], walls.direction[other]
    sine = float(first[0] * second[1] - first[1] * second[0])
    if abs(sine) < np.sin(settings.angle_min_rad):
        return None
    between_m = walls.middle_m[other] - walls.middle_m[one]
    along_first_m = float(between_m[0] * second[1] - between_m[1] * second[0]) / sine
    along_second_m = float(between_m[0] * first[1] - between_m[1] * first[0]) / sine
    if not (_at_end(walls, one, along_first_m, settings) and _at_end(walls, other, along_second_m, settings)):
        return None
    normals = np.array([[-first[1], first[0]], [-second[1], second[0]]])
    variance_m2 = np.array([_variance_m2(walls, one, along_first_m), _variance_m2(walls, other, along_second_m)])
    solved = np.linalg.inv(normals)
    return PerceivedCorner(
        position_m=walls.middle_m[one] + along_first_m * first,
        covariance_m2=solved @ np.diag(variance_m2) @ solved.T + settings.systematic_sigma_m**2 * np.eye(2),
        top_m=float(min(walls.top_m[one], walls.top_m[other])),
        points=int(walls.points[one] + walls.points[other]),
    )


def _at_end(walls: Walls, wall: int, along_m: float, settings: WallSettings) -> bool:
    nearest_m = min(abs(along_m - float(walls.begin_m[wall])), abs(along_m - float(walls.end_m[wall])))
    return nearest_m <= settings.reach_m


def _variance_m2(walls: Walls, wall: int, along_m: float) -> float:
    """Of the wall's line across, so far along it."""
    return float(walls.offset_sigma_m[wall] ** 2 + (walls.direction_sigma_rad[wall] * along_m) ** 2)
