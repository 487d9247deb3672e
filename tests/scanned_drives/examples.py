"""A vehicle on an arc over painted ground: every point is where the ground truly has it, at its own time."""

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.mapped import LandmarkSolved, Mapped, MapSolved, TrajectorySolved
from trigpoint.events.observed import MapFramePinned
from trigpoint.events.scanned import PointsScanned
from trigpoint.geodesy.positions import GridPosition
from trigpoint.geodesy.projection import MapFrame, pin_map_frame
from trigpoint.logs.memory_log import MemoryLog
from trigpoint_tiles.core.driven_path import DrivenPath, path_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
World = Callable[[Floats, np.random.Generator], tuple[Floats, Floats]]

FRAME = pin_map_frame(crs="EPSG:32756", origin=GridPosition(333_000.0, 6_248_000.0))
START_NS = 1_700_000_000_000_000_000
POSE_NS, SWEEP_NS = 100_000_000, 100_000_000
SPEED_MPS, YAW_RATE_RADPS = 10.0, 0.1
SENSOR_M = np.array([1.2, 0.1, 1.9])
SIGMA_M = 0.1
STRIPE_M = 1.0
DARK, BRIGHT = 20.0, 80.0
REACH_M = 25.0


def arc(seconds: float, *, start: tuple[float, float, float] = (100.0, 200.0, 0.3)) -> Floats:
    """Poses (n, 3) every tenth of a second on an arc."""
    t_s = np.arange(0.0, seconds + 1e-9, POSE_NS * 1e-9)
    heading = start[2] + YAW_RATE_RADPS * t_s
    radius_m = SPEED_MPS / YAW_RATE_RADPS
    x_m = start[0] + radius_m * (np.sin(heading) - np.sin(start[2]))
    y_m = start[1] - radius_m * (np.cos(heading) - np.cos(start[2]))
    return np.column_stack([x_m, y_m, heading])


def solved_path(vehicle: str, pose: Floats, *, map_version: int = 1, boot_id: str = "b") -> TrajectorySolved:
    """A path of these poses, as it is solved."""
    return TrajectorySolved(
        map_version=map_version,
        vehicle=vehicle,
        boot_id=boot_id,
        stamp_ns=START_NS + POSE_NS * np.arange(len(pose), dtype=np.int64),
        pose=pose,
        covariance=np.tile(np.diag([SIGMA_M**2, SIGMA_M**2, 1e-6]), (len(pose), 1, 1)),
        calibration=(),
    )


def painted_ground(around_m: Floats, random: np.random.Generator) -> tuple[Floats, Floats]:
    """Points (n, 3) on flat ground around places (n, 2), and how bright it is there: stripes in both directions."""
    off_m = random.uniform(-REACH_M, REACH_M, around_m.shape)
    point_m = around_m + off_m
    stripe = np.floor(point_m / STRIPE_M).sum(axis=1) % 2
    return np.column_stack([point_m, np.zeros(len(point_m))]), np.where(stripe == 0, DARK, BRIGHT)


def block_at(middle_m: tuple[float, float], *, side_m: float = 2.0, height_m: float = 1.5) -> World:
    """Painted ground with a block of this height on it, seen from above."""

    def seen(around_m: Floats, random: np.random.Generator) -> tuple[Floats, Floats]:
        point_m, bright = painted_ground(around_m, random)
        on_it = (np.abs(point_m[:, :2] - np.array(middle_m)) < side_m / 2).all(axis=1)
        point_m[on_it, 2] = height_m
        return point_m, bright

    return seen


def sweep_at(
    path: DrivenPath, stamp_ns: int, world: World, random: np.random.Generator, *, count: int = 4000, gain: float = 1.0
) -> PointsScanned:
    """A sweep over a tenth of a second from a stamp on; each point as the sensor saw it at its own time."""
    offset_ns = np.sort(random.integers(0, SWEEP_NS, count))
    pose = path.poses_at(stamp_ns + offset_ns)
    point_m, intensity = world(pose[:, :2], random)
    away_m = point_m[:, :2] - pose[:, :2]
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    base_m = np.column_stack([c * away_m[:, 0] + s * away_m[:, 1], c * away_m[:, 1] - s * away_m[:, 0], point_m[:, 2]])
    return PointsScanned(
        sensor="lidar",
        sensor_position_m=SENSOR_M,
        sensor_orientation=np.array([0.0, 0.0, 0.0, 1.0]),
        point_m=(base_m - SENSOR_M).astype(np.float32),
        intensity=(gain * intensity).astype(np.float32),
        offset_ns=offset_ns.astype(np.int32),
        ring=np.zeros(count, dtype=np.uint16),
    )


def drive_rows(
    vehicle: str, pose: Floats, *, world: World = painted_ground, seed: int = 1, gain: float = 1.0
) -> list[Envelope[PointsScanned]]:
    """A drive's sweeps from its first pose to the one before the last."""
    path, random = path_of(solved_path(vehicle, pose)), np.random.default_rng(seed)
    stamps = (START_NS + SWEEP_NS * number for number in range(len(pose) - 1))
    return [
        Envelope(EventIdentity(vehicle, "b", number), stamp, sweep_at(path, stamp, world, random, gain=gain))
        for number, stamp in enumerate(stamps)
    ]


def map_rows(
    paths: Iterable[TrajectorySolved],
    *,
    landmarks: Sequence[LandmarkSolved] = (),
    map_version: int = 1,
    first: int = 0,
) -> list[Envelope[Mapped]]:
    """A whole map version of these paths and landmarks."""
    head = MapSolved(
        map_version=map_version,
        method="anchored",
        settings_json="{}",
        inputs=(),
        landmark_count=len(landmarks),
        anchor_count=0,
        wall_s=0.0,
    )
    events: list[Mapped] = [*paths, *landmarks, head]
    return [
        Envelope(EventIdentity("optimisation", f"o{map_version}", first + number), START_NS, event)
        for number, event in enumerate(events)
    ]


def pinned(frame: MapFrame = FRAME) -> Envelope[MapFramePinned]:
    """The frame's event."""
    event = MapFramePinned(
        crs=frame.crs,
        origin_easting_m=frame.origin_easting_m,
        origin_northing_m=frame.origin_northing_m,
        declared_by="test",
    )
    return Envelope(EventIdentity("ingest", "i", 0), START_NS, event)


def scanned_log(drives: dict[str, list[Envelope[PointsScanned]]], paths: Iterable[TrajectorySolved]) -> MemoryLog:
    """A log of drives and one map version."""
    log = MemoryLog()
    log.append("map", [pinned()])
    for vehicle, rows in drives.items():
        log.append(f"veh-{vehicle}", rows)
    log.append("optimisation", map_rows(paths))
    return log
