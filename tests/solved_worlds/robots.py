"""A hall with marked posts, driven through by slow robots on command, without any positioning but their cameras."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from solved_worlds.examples import FRAME, START_NS
from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.drives import DetectionSeries, Drive, FixSeries, ImuSeries, WheelSeries
from trigpoint.events.observed import VehicleDescribed
from trigpoint.geodesy.poses import wrap_angles_rad
from trigpoint.geodesy.projection import wgs84_from_map_points

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

STEP_S = 0.1
DURATION_S = 60.0
DELAY_S = -0.2  # of the wheels' clock against the camera's
SPEED_SCALE, TURN_SCALE = 0.97, 0.95  # what becomes of a command
VIEW_RAD, REACH_M = 0.6, 6.0
LN_RANGE_SIGMA, BEARING_SIGMA_RAD = 0.005, 0.007
OFF_AXIS_PER_RAD2 = -0.5  # depth instead of range
POSTS_M = np.array([(1.0, 0.5), (5.0, 0.3), (7.0, 3.0), (4.0, 3.5), (0.5, 3.0), (2.5, 6.0), (6.0, 6.2), (8.0, 5.5)])


@dataclass(frozen=True, slots=True, kw_only=True)
class Hall:
    """Robots' drives, their true poses (n, 3) every `STEP_S`, and an anchor for each post."""

    drives: tuple[Drive, ...]
    poses: tuple[Floats, ...]
    anchors: tuple[AnchorLabelled, ...]


def _commands(seed: int, count: int) -> tuple[Floats, Floats]:
    """Speeds and yaw rates (n,), new ones every two seconds."""
    rng = np.random.default_rng(seed)
    held = count // 20 + 1
    speed = np.repeat(rng.choice([0.06, 0.15, 0.2], held), 20)[:count]
    turn = np.repeat(rng.normal(0.12, 0.25, held), 20)[:count]
    return speed, turn


def _driven(seed: int, count: int) -> tuple[Floats, Floats, Floats]:
    """True poses (n, 3) and the commands they came from."""
    speed, turn = _commands(seed, count)
    rng = np.random.default_rng(seed + 100)
    heading = np.cumsum(TURN_SCALE * turn * STEP_S + rng.normal(0.0, 0.002, count)) + seed
    step = SPEED_SCALE * speed * STEP_S + rng.normal(0.0, 0.001, count)
    x = 3.5 + np.cumsum(step * np.cos(heading))
    y = 3.0 + 0.7 * seed + np.cumsum(step * np.sin(heading))
    return np.column_stack([x, y, heading]), speed, turn


def _seen(own: int, poses: tuple[Floats, ...], rng: np.random.Generator) -> DetectionSeries:
    """Every half second the camera sees posts and other robots before it."""
    found = []
    for row in range(0, len(poses[own]), 5):
        others = {f"robot{i + 1}": pose[row, :2] for i, pose in enumerate(poses) if i != own}
        named = {f"post-{i}": post for i, post in enumerate(POSTS_M)} | others
        for name, place in named.items():
            ray = place - poses[own][row, :2]
            bearing = float(wrap_angles_rad(np.arctan2(ray[1], ray[0]) - poses[own][row, 2]))
            if abs(bearing) < VIEW_RAD and 0.5 < np.hypot(*ray) < REACH_M:
                found.append((row, float(np.hypot(*ray)), bearing, name))
    stamp_ns = np.array([START_NS + round(row * STEP_S * 1e9) for row, *_ in found], dtype=np.int64)
    bearing_rad = np.array([bearing for _, _, bearing, _ in found]) + rng.normal(0.0, BEARING_SIGMA_RAD, len(found))
    ln_range = np.log([range_m for _, range_m, _, _ in found]) + rng.normal(0.0, LN_RANGE_SIGMA, len(found))
    ln_range += OFF_AXIS_PER_RAD2 * (bearing_rad**2 - (bearing_rad**2).mean())
    names = tuple(name for *_, name in found)
    return DetectionSeries(
        stamp_ns=stamp_ns,
        range_m=np.exp(ln_range) / FRAME.point_scale,
        bearing_rad=bearing_rad,
        diameter_m=np.full(len(found), np.nan),
        kind=tuple("vehicle" if name.startswith("robot") else "post" for name in names),
        signature=names,
        sequence=np.arange(len(found), dtype=np.int64),
    )


def _robot(own: int, poses: tuple[Floats, ...], speed: Floats, turn: Floats) -> Drive:
    stamp_ns = START_NS + np.round((np.arange(len(speed)) * STEP_S + DELAY_S) * 1e9).astype(np.int64)
    nothing, none = np.zeros(0), np.zeros(0, dtype=np.int64)
    return Drive(
        vehicle=f"robot{own + 1}",
        boot_id="boot",
        described=VehicleDescribed(vehicle=f"robot{own + 1}", landmark_sensor_model="camera"),
        wheels=WheelSeries(
            stamp_ns=stamp_ns, speed_mps=speed, steering_rad=np.full(len(speed), np.nan), yaw_rate_radps=turn
        ),
        imu=ImuSeries(stamp_ns=none, yaw_rate_radps=nothing),
        fixes=FixSeries(stamp_ns=none, lat_deg=nothing, lon_deg=nothing, sigma_m=nothing, sequence=none),
        detections=_seen(own, poses, np.random.default_rng(own + 50)),
    )


def _surveyed(row: int) -> AnchorLabelled:
    lat_deg, lon_deg = wgs84_from_map_points(POSTS_M[row : row + 1], FRAME)
    return AnchorLabelled(
        anchor=f"survey-{row}",
        lat_deg=float(lat_deg[0]),
        lon_deg=float(lon_deg[0]),
        sigma_m=0.001,
        image="survey",
        image_sigma_m=0.0,
        kind="post",
        signature=f"post-{row}",
        source_crs="EPSG:4326",
        operation="",
    )


def hall(robots: int) -> Hall:
    """A hall with so many robots in it."""
    driven = [_driven(seed, round(DURATION_S / STEP_S)) for seed in range(robots)]
    poses = tuple(pose for pose, _, _ in driven)
    return Hall(
        drives=tuple(_robot(own, poses, speed, turn) for own, (_, speed, turn) in enumerate(driven)),
        poses=poses,
        anchors=tuple(_surveyed(row) for row in range(len(POSTS_M))),
    )


def without_landmarks(drive: Drive) -> Drive:
    """The drive with sightings of other robots only."""
    seen = drive.detections
    keep = np.array([kind == "vehicle" for kind in seen.kind], dtype=bool)
    rows = np.nonzero(keep)[0]
    return replace(
        drive,
        detections=DetectionSeries(
            stamp_ns=seen.stamp_ns[keep],
            range_m=seen.range_m[keep],
            bearing_rad=seen.bearing_rad[keep],
            diameter_m=seen.diameter_m[keep],
            kind=("vehicle",) * len(rows),
            signature=tuple(seen.signature[row] for row in rows),
            sequence=seen.sequence[keep],
        ),
    )
