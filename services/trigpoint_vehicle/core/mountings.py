"""How a sensor sits on its vehicle: where, and turned how, in the base frame."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError

Floats = NDArray[np.float64]

ORTHONORMAL_TOLERANCE = 1e-3  # of R Rᵀ against 1: calibrations are written with four digits and more


@dataclass(frozen=True, slots=True)
class Mounting:
    """`T_base_sensor`: `position_m` (3,) and `orientation` (4,), a unit quaternion x, y, z, w, as in PointsScanned."""

    position_m: Floats
    orientation: Floats

    def compose(self, other: "Mounting") -> "Mounting":
        """`T_a_c` from this `T_a_b` and `T_b_c`."""
        position_m = self.position_m + rotated(self.orientation, other.position_m)
        return Mounting(position_m, product(self.orientation, other.orientation))


def product(left: Floats, right: Floats) -> Floats:
    """The quaternion (4,) x, y, z, w that turns by `right`, then by `left`."""
    vector = left[3] * right[:3] + right[3] * left[:3] + np.cross(left[:3], right[:3])
    return np.append(vector, left[3] * right[3] - left[:3] @ right[:3])


def rotated(orientation: Floats, vector_m: Floats) -> Floats:
    """A vector (3,) turned by a unit quaternion (4,) x, y, z, w."""
    twice = 2.0 * np.cross(orientation[:3], vector_m)
    turned: Floats = vector_m + orientation[3] * twice + np.cross(orientation[:3], twice)
    return turned


AT_BASE = Mounting(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))


def quaternion_of_rotation(R_base_sensor: Floats) -> Floats:
    """The unit quaternion (4,) x, y, z, w of a rotation matrix (3, 3).

    Raises InputError for a matrix that is no rotation. By the largest component first (Shepperd 1978).
    """
    R = R_base_sensor
    off = float(np.abs(R @ R.T - np.eye(3)).max())
    if not off <= ORTHONORMAL_TOLERANCE or np.linalg.det(R) < 0.0:
        raise InputError(f"a matrix that is no rotation: R Rᵀ is {off:.3g} from 1, limit {ORTHONORMAL_TOLERANCE:g}")
    trace = float(np.trace(R))
    squares = np.array([1.0 + 2.0 * R[axis, axis] - trace for axis in range(3)] + [1.0 + trace])
    largest = int(np.argmax(squares))
    q = np.empty(4)
    if largest == 3:
        q[:3], q[3] = (R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]), squares[3]
    else:
        i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
        q[i], q[j], q[k], q[3] = squares[i], R[j, i] + R[i, j], R[k, i] + R[i, k], R[k, j] - R[j, k]
    unit: Floats = q / np.linalg.norm(q)
    return unit


def quaternion_of_angles(*, roll_rad: float, pitch_rad: float, yaw_rad: float) -> Floats:
    """The unit quaternion (4,) x, y, z, w that turns by roll about x, then pitch about y, then yaw about z, the axes of
    the base."""
    cr, sr = math.cos(roll_rad / 2.0), math.sin(roll_rad / 2.0)
    cp, sp = math.cos(pitch_rad / 2.0), math.sin(pitch_rad / 2.0)
    cy, sy = math.cos(yaw_rad / 2.0), math.sin(yaw_rad / 2.0)
    return np.array(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ]
    )
