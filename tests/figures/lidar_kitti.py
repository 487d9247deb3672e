"""KITTI 0005: poles found and found again, points sharper by deskewing, and perception against real time."""

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from figures.figure import Bounds, Figure, Measurement, at_least
from figures.workbench import Outcome, Workbench
from trigpoint.events.envelope import Envelope
from trigpoint.events.perceived import LandmarksPerceived, PerceivedLandmark
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.readings import logged_drives
from trigpoint_perception.app import STREAM
from trigpoint_perception.core.deskew import Path as BasePath
from trigpoint_perception.core.deskew import deskewed, poses_at
from trigpoint_perception.core.following import NumberedSweep, SweepFollower
from trigpoint_perception.core.motion_prior import wheel_path
from trigpoint_perception.core.odometry import LidarOdometry
from trigpoint_perception.core.perceiving import sights_of
from trigpoint_perception.core.sharpness import Sharpness, sharpness_of
from trigpoint_perception.core.sweep import Sweep, usable_sweep
from trigpoint_perception.settings import PerceptionSettings

Floats = NDArray[np.float64]

SETTINGS = PerceptionSettings()
DRIVE_STREAM = "veh-kitti"
EVERY_RING_OF_16 = 4  # of 64
SWEEP_S = 0.1
WARMED_UP = 3  # sweeps before the clock counts: compiled loops are loaded
NEAR_M = 20.0  # a pole that was seen within it should be seen again in the next sweep
MAPPED = slice(50, 62)  # sweeps of the sharpest turn, 0.25 rad/s at 5 m/s
MAPPED_RANGE_M = 30.0
ABOVE_GROUND_M = 0.4
QUERIES = 6000
RAW, STILL = "raw", "deskewed"
BY_OXTS, BY_LIDAR = "OXTS's speed and yaw rate", "lidar odometry"


def perceived(bench: Workbench) -> Outcome:
    """Convert, ingest and perceive, each a process of its own."""
    raw, data = bench.path("raw"), bench.path("data")
    bench.run("convert", "kitti", bench.drive("kitti_0005"), raw)
    bench.run("ingest", f"{raw}/kitti.mcap", "--data", data)
    return bench.run("perceive", "--data", data, "--json")


def logged_sweeps(log_path: Path) -> Iterator[NumberedSweep]:
    """The drive's sweeps."""
    with closing(McapLog(log_path)) as log:
        for logged in log.read(DRIVE_STREAM, kinds=(PointsScanned,)):
            row = cast(Envelope[PointsScanned], logged.envelope)
            yield NumberedSweep(sequence=row.identity.sequence, stamp_ns=row.stamp_ns, scanned=row.event)


def thinned(scanned: PointsScanned, every_ring: int) -> PointsScanned:
    """Every so many rings of a sweep."""
    chosen = scanned.ring % every_ring == 0
    return PointsScanned(
        sensor=scanned.sensor,
        sensor_position_m=scanned.sensor_position_m,
        sensor_orientation=scanned.sensor_orientation,
        point_m=scanned.point_m[chosen],
        intensity=scanned.intensity[chosen],
        offset_ns=scanned.offset_ns[chosen],
        ring=scanned.ring[chosen],
    )


def repeatability(log_path: Path) -> float:
    """The share of sights of a pole nearer than 20 m, but for its last, that the next sweep repeats."""
    sights: dict[int, list[tuple[int, PerceivedLandmark]]] = defaultdict(list)
    with closing(McapLog(log_path)) as log:
        events = [logged.envelope.event for logged in log.read(STREAM, kinds=(LandmarksPerceived,))]
    for number, event in enumerate(cast(list[LandmarksPerceived], events)):
        for landmark in event.landmarks:
            if landmark.kind == "pole":
                sights[landmark.track].append((number, landmark))
    again = [
        after[0] - before[0] == 1
        for each in sights.values()
        for before, after in zip(each, each[1:], strict=False)
        if np.hypot(before[1].x_m, before[1].y_m) <= NEAR_M
    ]
    return float(np.mean(again)) if again else float("nan")


def real_time_factor(work: Callable[[NumberedSweep], object], log_path: Path) -> float:
    """How many 16-beam sweeps of 0.1 s the work does in that time of one core."""
    seconds = []
    for sweep in logged_sweeps(log_path):
        thin = NumberedSweep(
            sequence=sweep.sequence, stamp_ns=sweep.stamp_ns, scanned=thinned(sweep.scanned, EVERY_RING_OF_16)
        )
        began_s = time.process_time()
        work(thin)
        seconds.append(time.process_time() - began_s)
    return SWEEP_S / float(np.mean(seconds[WARMED_UP:]))


def detection_factor(log_path: Path) -> float:
    """Of finding the landmarks of a sweep."""
    return real_time_factor(lambda one: sights_of(usable_sweep(one.scanned, SETTINGS.sweep), SETTINGS), log_path)


def following_factor(log_path: Path) -> float:
    """Of all of it: deskewing, finding, matching to the sweeps before, tracking."""
    return real_time_factor(SweepFollower("kitti", "thinned", SETTINGS).take, log_path)


@cache
def sharpness(log_path: Path, points: str, registered_by: str) -> Sharpness:
    """The map of the sweeps of one turn, above ground."""
    chosen = list(logged_sweeps(log_path))[MAPPED]
    with closing(McapLog(log_path)) as log:
        (drive,) = logged_drives(log)
    wheels = wheel_path(drive)
    assert wheels is not None  # OXTS is said to be the wheels
    placed = [_placed(sweep, points, wheels) for sweep in chosen]
    stamp_ns = np.array([sweep.stamp_ns for sweep in chosen], dtype=np.int64)
    poses = _poses(wheels, stamp_ns)
    if registered_by == BY_LIDAR:
        odometry = LidarOdometry(SETTINGS.odometry)
        poses = _matched(odometry, placed, poses)
    parts = []
    for sweep, T_map_base in zip(placed, poses, strict=True):
        near = sweep.run_m < MAPPED_RANGE_M
        point_m = sweep.point_m[near & (sweep.point_m[:, 2] > ABOVE_GROUND_M)][::2]
        parts.append(point_m @ T_map_base[:3, :3].T + T_map_base[:3, 3])
    mapped_m = np.concatenate(parts)
    return sharpness_of(mapped_m, np.random.default_rng(0).permutation(mapped_m)[:QUERIES])


def _placed(sweep: NumberedSweep, points: str, path: BasePath) -> Sweep:
    usable = usable_sweep(sweep.scanned, SETTINGS.sweep)
    if points == RAW:
        return usable
    still_m = deskewed(usable.point_m, usable.offset_ns, stamp_ns=sweep.stamp_ns, path=path)
    return replace(usable, point_m=still_m)


def _poses(path: BasePath, stamp_ns: NDArray[np.int64]) -> list[Floats]:
    position_m, rotation = poses_at(path, stamp_ns)
    poses = np.tile(np.eye(4), (len(stamp_ns), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rotation, position_m
    return list(poses)


def _matched(odometry: LidarOdometry, sweeps: list[Sweep], expected: list[Floats]) -> list[Floats]:
    """The sweeps' poses by matching each one, expected to move on as `expected` does."""
    poses: list[Floats] = []
    for number, sweep in enumerate(sweeps):
        guess = expected[0] if not poses else poses[-1] @ np.linalg.inv(expected[number - 1]) @ expected[number]
        poses.append(odometry.matched(sweep.point_m, guess).T_odom_base)
    return poses


def measured(name: str, unit: str, measure: Callable[[Path], float], target: Bounds | None = None) -> Figure:
    """A figure computed from the log that the commands made."""

    def value(bench: Workbench) -> Measurement:
        command = perceived(bench).command
        return Measurement(value=measure(Path(bench.path("data")) / "log"), command=command)

    return Figure(name=f"KITTI 0005: {name}", unit=unit, target=target, measure=value)


def counted(name: str, key: str) -> Figure:
    """A number of `trigpoint perceive`."""

    def value(bench: Workbench) -> Measurement:
        outcome = perceived(bench)
        return Measurement(value=float(outcome.answer["drives"][0][key]), command=outcome.command)

    return Figure(name=f"KITTI 0005: {name}", unit="", target=None, measure=value)


def gained(attribute: str, registered_by: str) -> Callable[[Path], float]:
    """By how much deskewed points are sharper than raw ones, positive where they are."""

    def value(log_path: Path) -> float:
        raw, still = (getattr(sharpness(log_path, points, registered_by), attribute) for points in (RAW, STILL))
        return float(raw - still)

    return value


def absolute(attribute: str, points: str, registered_by: str) -> Callable[[Path], float]:
    """The sharpness itself, lower is sharper."""
    return lambda log_path: float(getattr(sharpness(log_path, points, registered_by), attribute))


FIGURES = (
    counted("poles found", "poles"),
    counted("building corners found", "corners"),
    counted("sweeps matched to the one before, of 76", "matched"),
    measured("sights of a pole within 20 m that the next sweep repeats", "", repeatability),
    *(
        measured(f"{name} of {points} points, by {registered_by}", unit, absolute(attribute, points, registered_by))
        for registered_by in (BY_OXTS, BY_LIDAR)
        for attribute, name, unit in (("entropy", "mean map entropy", "nat"), ("thickness_m", "plane thickness", "m"))
        for points in (RAW, STILL)
    ),
    *(
        measured(f"{name} lost by deskewing, by {registered_by}", unit, gained(attribute, registered_by), at_least(0.0))
        for registered_by in (BY_OXTS, BY_LIDAR)
        for attribute, name, unit in (("entropy", "entropy", "nat"), ("thickness_m", "thickness", "m"))
    ),
    measured("finding landmarks in 16 beams, x real time on one core", "", detection_factor, at_least(5.0)),
    measured("all of perception on 16 beams, x real time on one core", "", following_factor, at_least(5.0)),
)
