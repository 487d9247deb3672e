"""Rigid motions of the plane, SE(2), for one pose and for arrays of them."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def wrap_angle_rad(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def wrap_angles_rad(angle_rad: Floats) -> Floats:
    """The same angles in [-pi, pi), any shape."""
    wrapped: Floats = (angle_rad + math.pi) % (2.0 * math.pi) - math.pi
    return wrapped


@dataclass(frozen=True, slots=True)
class Pose2:
    """A pose `T_a_b`: takes coordinates in frame b into frame a; heading counter-clockwise from a's x axis."""

    x_m: float
    y_m: float
    heading_rad: float

    def compose(self, other: "Pose2") -> "Pose2":
        """`T_a_c` from this `T_a_b` and `T_b_c`."""
        x_m, y_m = self.transform(other.x_m, other.y_m)
        return Pose2(x_m, y_m, wrap_angle_rad(self.heading_rad + other.heading_rad))

    def inverse(self) -> "Pose2":
        """`T_b_a` from this `T_a_b`."""
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return Pose2(-c * self.x_m - s * self.y_m, s * self.x_m - c * self.y_m, -self.heading_rad)

    def transform(self, x_m: float, y_m: float) -> tuple[float, float]:
        """A point of frame b in frame a, in metres."""
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return self.x_m + c * x_m - s * y_m, self.y_m + s * x_m + c * y_m


def transform_points(T_a_b: Floats, point_b_m: Floats) -> Floats:
    """Points in frame a, (n, 2) metres, from poses (n, 3) or (3,): x, y in m, heading in rad; points (n, 2) in b."""
    c, s = np.cos(T_a_b[..., 2]), np.sin(T_a_b[..., 2])
    x_m, y_m = point_b_m[..., 0], point_b_m[..., 1]
    return np.stack([T_a_b[..., 0] + c * x_m - s * y_m, T_a_b[..., 1] + s * x_m + c * y_m], axis=-1)
