"""What was observed over a stretch of a path as one constellation around where the base is now."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.client.core.constellations import Constellation

Floats = NDArray[np.float64]

MERGED_M = 0.4  # sightings of one kind that are nearer to each other are of one thing
DRIFT_M_PER_M, DRIFT_RAD_PER_M, DRIFT_RAD_PER_RAD = 0.05, 0.03, 0.08  # of a small robot's wheels since a sighting


@dataclass(slots=True)
class _Thing:
    kind: str
    information: Floats
    weighted_m: Floats
    point_m: Floats = field(default_factory=lambda: np.zeros(2))
    count: int = 0

    def take(self, point_m: Floats, information: Floats) -> None:
        self.information = self.information + information
        self.weighted_m = self.weighted_m + information @ point_m
        self.point_m = np.asarray(np.linalg.solve(self.information, self.weighted_m), dtype=np.float64)
        self.count += 1


def gathered(
    sightings: Constellation, T_odom_base: Floats, *, merged_m: float = MERGED_M, common_sigma_m: float = 0.05
) -> Constellation:
    """The things sighted, in the base's frame at T_odom_base (3,), each once.

    `sightings` are in the odometry's frame, one row each in order of time; those of one kind within `merged_m` become
    one thing at their weighted mean. `common_sigma_m` is what repeating a sighting does not average out.
    """
    things: list[_Thing] = []
    for point_m, covariance_m2, kind in zip(sightings.point_m, sightings.covariance_m2, sightings.kind, strict=True):
        near = [(float(np.hypot(*(one.point_m - point_m))), one) for one in things if one.kind == kind]
        away_m, nearest = min(near, key=lambda pair: pair[0], default=(np.inf, None))
        if nearest is None or away_m > merged_m:
            nearest = _Thing(kind=kind, information=np.zeros((2, 2)), weighted_m=np.zeros(2))
            things.append(nearest)
        nearest.take(point_m, np.linalg.inv(covariance_m2))
    return _around(things, T_odom_base, common_sigma_m)


def drifted(sightings: Constellation, T_odom_base: Floats, *, path_m: Floats, turned_rad: Floats) -> Constellation:
    """The sightings with what odometry may have added since: path_m (n,) driven and turned_rad (n,) turned since each,
    seen from the base at T_odom_base (3,)."""
    away_m = sightings.point_m - T_odom_base[:2]
    aside_m = np.stack([-away_m[:, 1], away_m[:, 0]], axis=-1)
    heading_rad2 = (DRIFT_RAD_PER_M * path_m) ** 2 + (DRIFT_RAD_PER_RAD * turned_rad) ** 2
    along_m2 = (DRIFT_M_PER_M * path_m) ** 2
    added_m2 = along_m2[:, None, None] * np.eye(2) + np.einsum("n,ni,nj->nij", heading_rad2, aside_m, aside_m)
    return replace(sightings, covariance_m2=sightings.covariance_m2 + added_m2)


def _around(things: list[_Thing], T_odom_base: Floats, common_sigma_m: float) -> Constellation:
    c, s = np.cos(T_odom_base[2]), np.sin(T_odom_base[2])
    R_base_odom = np.array([[c, s], [-s, c]])
    point_m = np.array([one.point_m for one in things]).reshape(-1, 2)
    own_m2 = np.array([np.linalg.inv(one.information) for one in things]).reshape(-1, 2, 2)
    return Constellation(
        point_m=(point_m - T_odom_base[:2]) @ R_base_odom.T,
        covariance_m2=R_base_odom @ own_m2 @ R_base_odom.T + common_sigma_m**2 * np.eye(2),
        kind=tuple(one.kind for one in things),
    )
