"""KITTI 0005: poles found and found again, points sharper by deskewing, and perception against real time."""

import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from figures.figure import Bounds, Figure, Measurement, at_least
from figures.workbench import Workbench
from kitti_sweeps.reading import PERIOD_NS, SCANS, inertial_path, scanned, stamp_ns
from trigpoint.events.perceived import LandmarksPerceived, PerceivedLandmark
from trigpoint_perception.core.deskew import Path as BasePath
from trigpoint_perception.core.deskew import deskewed
from trigpoint_perception.core.following import NumberedSweep, SweepFollower
from trigpoint_perception.core.perceiving import sights_of
from trigpoint_perception.core.sharpness import Sharpness, sharpness_of
from trigpoint_perception.core.sweep import usable_sweep
from trigpoint_perception.settings import PerceptionSettings

Floats = NDArray[np.float64]

COMMAND = "python -m figures --only lidar"
SETTINGS = PerceptionSettings()
EVERY_RING_OF_16 = 4  # of 64
SWEEP_S = 0.1
WARMED_UP = 3  # sweeps before the clock counts: compiled loops are loaded
NEAR_M = 20.0  # within it a pole should be seen again in the next sweep
MAPPED_SCANS = range(100, 124, 2)  # the sharpest turn of the drive, 0.25 rad/s at 5 m/s
MAPPED_RANGE_M = 30.0
ABOVE_GROUND_M = 0.4
QUERIES = 6000


@dataclass(frozen=True, slots=True, kw_only=True)
class Followed:
    """A drive followed: events of its sweeps, CPU time of each in s, and the base's poses by odometry."""

    landmarks: tuple[LandmarksPerceived, ...]
    seconds: tuple[float, ...]


@cache
def followed(folder: Path, every_ring: int) -> Followed:
    """All scans of the drive, every so many rings of them."""
    follower, events, seconds = SweepFollower("kitti", "0005", SETTINGS), [], []
    for scan in SCANS:
        sweep = scanned(folder, scan, every_ring=every_ring)
        began_s = time.process_time()
        events += follower.take(NumberedSweep(sequence=scan, stamp_ns=stamp_ns(scan), scanned=sweep))
        seconds.append(time.process_time() - began_s)
    events += follower.finished()
    landmarks = tuple(event for _, event in events if isinstance(event, LandmarksPerceived))
    return Followed(landmarks=landmarks, seconds=tuple(seconds))


def sights_by_thing(one: Followed) -> dict[tuple[str, int], list[tuple[int, PerceivedLandmark]]]:
    """The sights of each thing, with the scan's place in the order of all."""
    things: dict[tuple[str, int], list[tuple[int, PerceivedLandmark]]] = defaultdict(list)
    for number, event in enumerate(one.landmarks):
        for landmark in event.landmarks:
            things[landmark.kind, landmark.track].append((number, landmark))
    return things


def things_found(one: Followed, kind: str) -> float:
    """How many things of a kind were observed."""
    return float(sum(name[0] == kind for name in sights_by_thing(one)))


def repeatability(one: Followed, kind: str) -> float:
    """The share of sweeps, after each near sight but a thing's last, in which it was seen again at once."""
    again = [
        after[0] - before[0] == 1
        for name, sights in sights_by_thing(one).items()
        if name[0] == kind
        for before, after in zip(sights, sights[1:], strict=False)
        if np.hypot(before[1].x_m, before[1].y_m) <= NEAR_M
    ]
    return float(np.mean(again)) if again else float("nan")


def real_time_factor(seconds: tuple[float, ...]) -> float:
    """Sweeps of 0.1 s by the CPU time they took, on one core."""
    return SWEEP_S / float(np.mean(seconds[WARMED_UP:]))


@cache
def detection_seconds(folder: Path, every_ring: int) -> tuple[float, ...]:
    """The CPU time in s of finding landmarks in each scan, without deskewing, matching and tracking."""
    seconds = []
    for scan in SCANS:
        sweep = scanned(folder, scan, every_ring=every_ring)
        began_s = time.process_time()
        sights_of(usable_sweep(sweep, SETTINGS.sweep), SETTINGS)
        seconds.append(time.process_time() - began_s)
    return tuple(seconds)


@cache
def sharpness(folder: Path, registered_by: str, share: float) -> Sharpness:
    """The map of some scans, each registered as it is raw (share 0) or deskewed (1): by OXTS, or by matching it."""
    return sharpness_of(*mapped_points(folder, registered_by, share))


def mapped_points(folder: Path, registered_by: str, share: float) -> tuple[Floats, Floats]:
    """The points above ground (n, 3) of the mapped scans in one frame, and some of them (m, 3) to measure at."""
    from trigpoint_perception.core.odometry import LidarOdometry

    T_start_base = inertial_path(folder).T_start_base
    path, odometry, parts = inertial_base_path(T_start_base), LidarOdometry(SETTINGS.odometry), []
    T_map_base = T_start_base[MAPPED_SCANS[0]]
    for scan in MAPPED_SCANS:
        sweep = usable_sweep(scanned(folder, scan), SETTINGS.sweep)
        offset_ns = np.round(share * sweep.offset_ns).astype(np.int64)
        point_m = deskewed(sweep.point_m, offset_ns, stamp_ns=stamp_ns(scan), path=path)
        motion = np.linalg.inv(T_start_base[max(scan - 2, MAPPED_SCANS[0])]) @ T_start_base[scan]
        T_map_base = T_start_base[scan]
        if registered_by == "lidar":
            expected = T_start_base[scan] if not parts else last @ motion
            last = odometry.matched(point_m, expected).T_odom_base
            T_map_base = last
        near = (np.hypot(sweep.direction_m[:, 0], sweep.direction_m[:, 1]) < MAPPED_RANGE_M) & (
            point_m[:, 2] > ABOVE_GROUND_M
        )
        parts.append(point_m[near][::2] @ T_map_base[:3, :3].T + T_map_base[:3, 3])
    point_m = np.concatenate(parts)
    chosen = np.random.default_rng(0).choice(len(point_m), QUERIES, replace=False)
    return point_m, point_m[chosen]
