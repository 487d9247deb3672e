"""KITTI 0005: sweeps with ring and time by azimuth, and the inertial unit's poses of the base."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from trigpoint.events.scanned import PointsScanned

Floats = NDArray[np.float64]

START_NS = 1_317_000_000_000_000_000
PERIOD_NS = 103_600_000  # between two rows of OXTS: the drive's own time stamps, nominal 10 Hz
TURN_NS = 100_000_000  # of the sensor
UNIT_M = 0.005
SENSOR_M = np.array([0.76, 0.0, 1.73])  # KITTI set-up: 0.76 m before the rear axle, 1.73 m above the ground
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])
EARTH_M = 6_378_137.0
SCANS = range(0, 154, 2)


def stamp_ns(scan: int) -> int:
    """When a scan's sensor looked ahead."""
    return START_NS + scan * PERIOD_NS


def scanned(folder: Path, scan: int, *, every_ring: int = 1) -> PointsScanned:
    """A scan, or every so many of its 64 rings; the sensor turns clockwise and looks ahead at the stamp."""
    with np.load(folder / f"scan_{scan:04d}.npz") as file:
        point_m = (file["xyz_5mm"] * UNIT_M).astype(np.float32)
        intensity = file["intensity"].astype(np.float32)
    azimuth_rad = np.arctan2(point_m[:, 1], point_m[:, 0])
    turned = np.mod(azimuth_rad, 2.0 * np.pi)
    ring = np.concatenate([[0], np.cumsum(np.diff(turned) < -3.0)]).astype(np.uint16)
    chosen = ring % every_ring == 0
    return PointsScanned(
        sensor="velodyne",
        sensor_position_m=SENSOR_M,
        sensor_orientation=LEVEL,
        point_m=point_m[chosen],
        intensity=intensity[chosen],
        offset_ns=(-azimuth_rad / (2.0 * np.pi) * TURN_NS).astype(np.int32)[chosen],
        ring=ring[chosen],
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class InertialPath:
    """The base's poses (n, 4, 4) in the frame of the first one, one a row of OXTS; the base frame is the sensor's,
    moved by its mount."""

    T_start_base: Floats


def inertial_path(folder: Path) -> InertialPath:
    """The poses OXTS tells, on the Mercator plane of the first latitude (Geiger et al. 2013)."""
    rows = np.loadtxt(folder / "oxts" / "oxts.txt")
    latitude, longitude = np.radians(rows[:, 0]), np.radians(rows[:, 1])
    scale = np.cos(latitude[0])
    T_world_imu = np.tile(np.eye(4), (len(rows), 1, 1))
    T_world_imu[:, :3, :3] = Rotation.from_euler("ZYX", rows[:, [5, 4, 3]]).as_matrix()
    T_world_imu[:, 0, 3] = scale * EARTH_M * longitude
    T_world_imu[:, 1, 3] = scale * EARTH_M * np.log(np.tan(np.pi / 4.0 + latitude / 2.0))
    T_world_imu[:, 2, 3] = rows[:, 2]
    T_base_velo = np.eye(4)
    T_base_velo[:3, 3] = SENSOR_M
    T_imu_base = np.linalg.inv(_velo_from_imu(folder)) @ np.linalg.inv(T_base_velo)
    T_world_base = T_world_imu @ T_imu_base
    return InertialPath(T_start_base=np.linalg.inv(T_world_base[0]) @ T_world_base)


def _velo_from_imu(folder: Path) -> Floats:
    for line in (folder / "oxts" / "tracking_calib.txt").read_text().splitlines():
        name, _, numbers = line.partition(" ")
        if name == "Tr_imu_velo":
            return np.vstack([np.array(numbers.split(), dtype=np.float64).reshape(3, 4), [0.0, 0.0, 0.0, 1.0]])
    raise ValueError(f"{folder}: tracking_calib.txt has no line Tr_imu_velo")
