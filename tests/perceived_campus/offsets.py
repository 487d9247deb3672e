"""Sights of poles along a simulated street against the poles: how much too far, aside and too thick."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from perceived_campus.finding import driven_along, poles_of
from trigpoint.events.perceived import PerceivedLandmark
from trigpoint_perception.core.perceiving import POLE

Floats = NDArray[np.float64]

NEAR_M = 0.5  # a sight further from every pole is of something else


@dataclass(frozen=True, slots=True, kw_only=True)
class PoleOffsets:
    """Sights of poles (n,): too_far_m along the sensor's ray and aside_m to the left of it; their 1-sigmas as told,
    along_sigma_m and aside_sigma_m; too_thick_m by the radius."""

    too_far_m: Floats
    aside_m: Floats
    along_sigma_m: Floats
    aside_sigma_m: Floats
    too_thick_m: Floats

    @property
    def nees_along(self) -> float:
        """The mean normalised squared error along the ray."""
        return float(((self.too_far_m / self.along_sigma_m) ** 2).mean())

    @property
    def nees_aside(self) -> float:
        """The mean normalised squared error across the ray."""
        return float(((self.aside_m / self.aside_sigma_m) ** 2).mean())


@cache
def pole_offsets_along(*, length_m: float, seed: int) -> PoleOffsets:
    """The offsets of all sights of poles and trunks along a straight street driven once."""
    drive = driven_along(length_m=length_m, seed=seed)
    poles, sensor = poles_of(drive.scanned.scene), drive.scanned.scans[0].settings
    tree, mount_m = cKDTree(poles.place_m), np.array([sensor.x_m, sensor.y_m])
    rows = list[tuple[float, ...]]()
    for event, pose in drive.told:
        turn = np.array([[np.cos(pose[2]), -np.sin(pose[2])], [np.sin(pose[2]), np.cos(pose[2])]])
        for one in event.landmarks:
            off_m, of = tree.query(pose[:2] + turn @ np.array([one.x_m, one.y_m]))
            if one.kind == POLE and off_m <= NEAR_M:
                true_m = turn.T @ (poles.place_m[of] - pose[:2])
                rows.append((*_offsets(one, true_m, mount_m), 0.5 * one.diameter_m - float(poles.radius_m[of])))
    too_far_m, aside_m, along_sigma_m, aside_sigma_m, too_thick_m = np.array(rows).reshape(-1, 5).T
    return PoleOffsets(
        too_far_m=too_far_m,
        aside_m=aside_m,
        along_sigma_m=along_sigma_m,
        aside_sigma_m=aside_sigma_m,
        too_thick_m=too_thick_m,
    )


def _offsets(one: PerceivedLandmark, true_m: Floats, mount_m: Floats) -> tuple[float, float, float, float]:
    """The error of a sight of what is at true_m (2,) in the base frame, along the ray from the sensor at mount_m (2,)
    and to its left, and the sigmas of both."""
    ray_m = true_m - mount_m
    axes = np.array([ray_m, [-ray_m[1], ray_m[0]]]) / np.hypot(*ray_m)
    told_m2 = np.array([[one.variance_x_m2, one.covariance_xy_m2], [one.covariance_xy_m2, one.variance_y_m2]])
    along_m, aside_m = (axes @ (np.array([one.x_m, one.y_m]) - true_m)).tolist()
    along_sigma_m, aside_sigma_m = np.sqrt(np.diag(axes @ told_m2 @ axes.T)).tolist()
    return along_m, aside_m, along_sigma_m, aside_sigma_m
