"""Detections of a vehicle as positions on the earth, with what is uncertain of detection and pose together."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.client.core.constellations import Constellation
from trigpoint.errors import InputError
from trigpoint.geodesy.poses import transform_points
from trigpoint.geodesy.projection import MapFrame, wgs84_from_map_points

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class VehiclePose:
    """T_map_base (3,): x, y in m, heading in rad, of the base in the map frame, with covariance (3, 3).

    Raises InputError where the shapes are others, a number is not finite or the covariance is no covariance.
    """

    T_map_base: Floats
    covariance: Floats

    def __post_init__(self) -> None:
        if self.T_map_base.shape != (3,) or self.covariance.shape != (3, 3):
            raise InputError(f"pose of shape {self.T_map_base.shape}, covariance {self.covariance.shape}: (3,), (3, 3)")
        if not (np.isfinite(self.T_map_base).all() and np.isfinite(self.covariance).all()):
            raise InputError("a pose or its covariance is not finite")
        least = float(np.linalg.eigvalsh(self.covariance)[0])
        if least < -1e-12 or not np.allclose(self.covariance, self.covariance.T, rtol=1e-6, atol=1e-12):
            raise InputError(f"a pose's covariance is not symmetric, or has an eigenvalue of {least:g}, below 0")


@dataclass(frozen=True, slots=True, kw_only=True)
class Placed:
    """Detections (n,) on the earth: latitude and longitude in degrees on WGS84, point_m (n, 2) in the map frame.

    joint_covariance_m2 (2n, 2n) along true east and north, in metres on the ground, of detections 0, 0, 1, 1, …: they
    share the pose's error, so that they are uncertain together.
    """

    lat_deg: Floats
    lon_deg: Floats
    point_m: Floats
    joint_covariance_m2: Floats

    @property
    def covariance_m2(self) -> Floats:
        """Each detection's own covariance (n, 2, 2), rows and columns true east, true north."""
        count = len(self.lat_deg)
        blocks = self.joint_covariance_m2.reshape(count, 2, count, 2)
        return np.asarray(blocks[np.arange(count), :, np.arange(count)])


def placed(detections: Constellation, pose: VehiclePose, frame: MapFrame) -> Placed:
    """Where detections (in the base's frame, metres on the ground) are, to first order in every error.

    Raises FrameRefused for a place outside the projection's domain.
    """
    scale, heading_rad = frame.point_scale, pose.T_map_base[2]
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    R_map_base = np.array([[c, -s], [s, c]])
    point_m = transform_points(pose.T_map_base, scale * detections.point_m)
    lat_deg, lon_deg = wgs84_from_map_points(point_m, frame)
    jacobian = _pose_jacobian(point_m - pose.T_map_base[:2])
    joint_m2 = jacobian @ pose.covariance @ jacobian.T
    own_m2 = scale**2 * (R_map_base @ detections.covariance_m2 @ R_map_base.T)
    for number, each_m2 in enumerate(own_m2):
        joint_m2[2 * number : 2 * number + 2, 2 * number : 2 * number + 2] += each_m2
    R_true_map = np.kron(np.eye(len(detections)), true_from_grid(frame))
    true_m2 = R_true_map @ joint_m2 @ R_true_map.T
    return Placed(lat_deg=lat_deg, lon_deg=lon_deg, point_m=point_m, joint_covariance_m2=0.5 * (true_m2 + true_m2.T))


def true_from_grid(frame: MapFrame) -> Floats:
    """The matrix (2, 2) that takes grid east and north metres into true east and north metres on the ground."""
    c, s = math.cos(frame.convergence_rad), math.sin(frame.convergence_rad)
    return np.array([[c, s], [-s, c]]) / frame.point_scale


def _pose_jacobian(offset_m: Floats) -> Floats:
    """How positions (2n,) move with the pose (3,); offset_m (n, 2) from the base, along the map's axes."""
    jacobian = np.zeros((len(offset_m), 2, 3))
    jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1.0
    jacobian[:, 0, 2], jacobian[:, 1, 2] = -offset_m[:, 1], offset_m[:, 0]
    return jacobian.reshape(-1, 3)
