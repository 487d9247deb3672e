"""Sights of landmarks against the truth: how far off, by their own covariances, and how much of it lasts a pass."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from trigpoint.events.drives import Drive
from trigpoint.events.truth import Truth, TruthPath
from trigpoint.geodesy.poses import transform_points
from trigpoint.geodesy.projection import MapFrame, map_points_from_wgs84

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NEAR_M = 1.0  # a sight further from everything true is of nothing
CHI2_95_2DOF = 5.991
LATER_NS = 4_000_000_000  # sights of one thing this much later have another view of it


@dataclass(frozen=True, slots=True, kw_only=True)
class SightErrors:
    """Errors of sights (n,): error_m (n, 2) in the base frame, along its axes; nees (n,) by their own covariances;
    `too_far_m` (n,) along the ray; `of` (n,) the true thing; stamp_ns (n,)."""

    error_m: Floats
    nees: Floats
    too_far_m: Floats
    of: Ints
    stamp_ns: Ints

    @property
    def nees_per_dof(self) -> float:
        """The mean normalised squared error over its two degrees of freedom."""
        return float(self.nees.mean()) / 2.0

    @property
    def inside_95(self) -> float:
        """The share inside their 95 % ellipses."""
        return float((self.nees <= CHI2_95_2DOF).mean())

    @property
    def lasting(self) -> float:
        """The correlation of a sight's error along the ray with that of the same thing `LATER_NS` later."""
        order = np.lexsort((self.stamp_ns, self.of))
        of, stamp_ns, off_m = self.of[order], self.stamp_ns[order], self.too_far_m[order]
        later = np.searchsorted(
            of * np.int64(2**40) + _tenths(stamp_ns), of * np.int64(2**40) + _tenths(stamp_ns + LATER_NS)
        )
        later = np.minimum(later, len(of) - 1)
        same = (of[later] == of) & (np.abs(stamp_ns[later] - stamp_ns - LATER_NS) < LATER_NS // 10)
        return float(np.mean(off_m[same] * off_m[later[same]]) / np.mean(off_m**2))


def _tenths(stamp_ns: Ints) -> Ints:
    """Tenths of seconds since some day: small enough to be a part of a key."""
    tenths: Ints = stamp_ns // 100_000_000 % 2**39
    return tenths


def sight_errors(drive: Drive, truth: Truth, frame: MapFrame, *, kind: str) -> SightErrors:
    """The errors of a drive's detections of one kind that tell their covariance."""
    detections, described = drive.detections, drive.described
    assert detections.covariance_m2 is not None, "a perceived drive tells covariances"
    rows = np.array([own == kind for own in detections.kind], dtype=bool)
    angle = detections.bearing_rad[rows] + described.landmark_sensor_yaw_rad
    ray = np.column_stack([np.cos(angle), np.sin(angle)])
    mount_m = np.array([described.landmark_sensor_x_m, described.landmark_sensor_y_m])
    seen_m = mount_m + detections.range_m[rows, None] * ray
    (path,) = [path for path in truth.paths if path.vehicle == drive.vehicle]
    pose = _true_poses(path, frame, detections.stamp_ns[rows])
    known_m = _in_map(np.array([(one.lat_deg, one.lon_deg) for one in truth.landmarks]), frame)
    away_m, of = cKDTree(known_m).query(transform_points(pose, frame.point_scale * seen_m))
    error_m = seen_m - _in_base(pose, known_m[of]) / frame.point_scale
    near = away_m <= NEAR_M
    covariance = detections.covariance_m2[rows][near]
    solved = np.linalg.solve(covariance, error_m[near][..., None])[..., 0]
    return SightErrors(
        error_m=error_m[near],
        nees=np.einsum("na,na->n", error_m[near], solved),
        too_far_m=np.einsum("na,na->n", error_m[near], ray[near]),
        of=of[near].astype(np.int64),
        stamp_ns=detections.stamp_ns[rows][near],
    )


def _in_map(wgs84_deg: Floats, frame: MapFrame) -> Floats:
    return map_points_from_wgs84(wgs84_deg[:, 0], wgs84_deg[:, 1], frame)


def _true_poses(path: TruthPath, frame: MapFrame, stamp_ns: Ints) -> Floats:
    """The base's true poses (n, 3) in the map at stamps (n,)."""
    known = np.column_stack(
        [_in_map(np.column_stack([path.lat_deg, path.lon_deg]), frame), np.unwrap(path.heading_rad)]
    )
    known_s, at_s = (path.stamp_ns - path.stamp_ns[0]) * 1e-9, (stamp_ns - path.stamp_ns[0]) * 1e-9
    return np.column_stack([np.interp(at_s, known_s, column) for column in known.T])


def _in_base(pose: Floats, point_m: Floats) -> Floats:
    """Points (n, 2) of the map in the frames of poses (n, 3)."""
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    east, north = (point_m - pose[:, :2]).T
    return np.column_stack([c * east + s * north, c * north - s * east])
