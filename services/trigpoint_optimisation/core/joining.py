"""Drives without fixes brought into the map: each in its own frame first, then joined by landmarks they share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.geodesy.poses import transform_points, wrap_angles_rad
from trigpoint_optimisation.core.alignment import weighted_rigid

Floats = NDArray[np.float64]
Points = Mapping[str, Floats]  # a landmark's signature, and where it is (2,)

MIN_COMMON = 2  # shared landmarks that fix a rigid motion
ROBUST_ROUNDS = 20
SCALE_FLOOR_M = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalDrive:
    """A drive in a frame of its own: pose (n, 3) of its keyframes, and the landmarks it knows by signature."""

    pose: Floats
    point_m: Points


def rigid_onto(point_m: Points, reference_m: Points) -> Floats | None:
    """The rigid motion (3,) that brings points onto those of the same signature, Cauchy-weighted; None where they
    share fewer than two."""
    common = sorted(set(point_m) & set(reference_m))
    if len(common) < MIN_COMMON:
        return None
    here, there = np.array([point_m[name] for name in common]), np.array([reference_m[name] for name in common])
    weight, motion = np.ones(len(common)), np.zeros(3)
    for _ in range(ROBUST_ROUNDS):
        found = weighted_rigid(here, there, weight)
        motion = np.array([found.x_m, found.y_m, found.heading_rad])
        off_m = np.hypot(*(transform_points(motion, here) - there).T)
        weight = 1.0 / (1.0 + (off_m / (2.0 * max(float(np.median(off_m)), SCALE_FLOOR_M))) ** 2)
    return motion


def moved(local: LocalDrive, motion: Floats) -> LocalDrive:
    """The drive after a rigid motion (3,) of its frame."""
    heading = wrap_angles_rad(local.pose[:, 2] + motion[2])
    return LocalDrive(
        pose=np.column_stack([transform_points(motion, local.pose[:, :2]), heading]),
        point_m={name: transform_points(motion, point) for name, point in local.point_m.items()},
    )


def mean_points(parts: Sequence[Points]) -> dict[str, Floats]:
    """Each landmark's mean over the drives that know it."""
    names = sorted({name for part in parts for name in part})
    return {name: np.mean([part[name] for part in parts if name in part], axis=0) for name in names}


def joined_drives(local: Mapping[int, LocalDrive]) -> list[dict[int, LocalDrive]]:
    """The drives in as few frames as landmarks they share allow, each frame that of the drive that knows most."""
    left, groups = dict(local), []
    while left:
        first = max(left, key=lambda index: (len(left[index].point_m), -index))
        group = {first: left.pop(first)}
        while left:
            known = mean_points([each.point_m for each in group.values()])
            nearest = max(left, key=lambda index: (len(set(left[index].point_m) & set(known)), -index))
            motion = rigid_onto(left[nearest].point_m, known)
            if motion is None:
                break
            group[nearest] = moved(left.pop(nearest), motion)
        groups.append(group)
    return groups
