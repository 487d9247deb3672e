"""Planar poses (3,), x, y in m and heading in rad, as spatial ones (4, 4), and how their errors show elsewhere."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def planar_pose(T_parent_child: Floats) -> Floats:
    """x, y in m and heading in rad (3,) of a pose (4, 4)."""
    heading_rad = np.arctan2(T_parent_child[1, 0], T_parent_child[0, 0])
    return np.array([T_parent_child[0, 3], T_parent_child[1, 3], heading_rad])


def spatial_pose(pose: Floats) -> Floats:
    """A planar pose (3,) as (4, 4), level."""
    spatial = np.eye(4)
    spatial[:2, :2] = _turn(float(pose[2]))
    spatial[:2, 3] = pose[:2]
    return spatial


def in_parent_axes(covariance: Floats, heading_rad: float) -> Floats:
    """A covariance (3, 3) of x, y and heading in the axes of what is turned by so much, in those it is turned from."""
    turned = np.eye(3)
    turned[:2, :2] = _turn(heading_rad)
    seen: Floats = turned @ covariance @ turned.T
    return seen


def by_parent(covariance: Floats, pose: Floats) -> Floats:
    """What an error (3, 3) of the parent, in its own axes, makes of a pose (3,) as seen from it."""
    moved = np.array([[1.0, 0.0, -pose[1]], [0.0, 1.0, pose[0]], [0.0, 0.0, 1.0]])
    carried: Floats = moved @ covariance @ moved.T
    return carried


def _turn(angle_rad: float) -> Floats:
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, -s], [s, c]])
