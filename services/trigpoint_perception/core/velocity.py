"""Velocities of the base (6,), a rotation vector in rad/s first, then m/s, and the motions they make."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]


def motions(velocity: Floats, dt_s: Floats) -> tuple[Floats, Floats]:
    """How far (m, 3) and how much turned (m, 3, 3) the base is after times (m,) at a velocity held so long, in the base
    frame before."""
    return dt_s[:, None] * velocity[3:], Rotation.from_rotvec(dt_s[:, None] * velocity[:3]).as_matrix()


def expected_motion(velocity: Floats, dt_s: float) -> Floats:
    """The motion (4, 4) of a velocity (6,) held for so long."""
    motion = np.eye(4)
    (motion[:3, 3],), (motion[:3, :3],) = motions(velocity, np.array([dt_s]))
    return motion


def velocity_of(motion: Floats, dt_s: float) -> Floats:
    """The velocity (6,) whose motion over `dt_s` this is."""
    return np.concatenate([Rotation.from_matrix(motion[:3, :3]).as_rotvec(), motion[:3, 3]]) / dt_s
