"""A block with poles around it, driven round by seeded vehicles, and labels in two aerial images."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.drives import DetectionSeries, Drive, FixSeries, ImuSeries, WheelSeries
from trigpoint.events.observed import VehicleDescribed
from trigpoint.geodesy.poses import transform_points, wrap_angles_rad
from trigpoint.geodesy.positions import GridPosition
from trigpoint.geodesy.projection import MapFrame, pin_map_frame, wgs84_from_map_points

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FRAME: MapFrame = pin_map_frame(crs="EPSG:32756", origin=GridPosition(332_000.0, 6_248_000.0))
START_NS = 1_700_000_000_000_000_000
STEP_S = 0.05
CENTRE_M = np.array([600.0, 500.0])
ANTENNA_M = np.array([1.2, 0.3])
SENSOR_M = np.array([1.8, 0.0])
REACH_M = 25.0
IMAGES = ("east", "west")
IMAGE_SIGMA_M = 0.35
LABEL_SIGMA_M = 0.10


@dataclass(frozen=True, slots=True, kw_only=True)
class Lap:
    """How one vehicle goes round the block, and what its sensors get wrong."""

    vehicle: str = "car"
    duration_s: float = 110.0
    speed_mps: float = 6.0
    begin_rad: float = 0.4  # where around the block
    speed_scale: float = 1.01  # true speed over measured speed
    yaw_bias_radps: float = 0.002
    white_m: float = 1.0
    slow_m: float = 1.5  # of fixes, Gauss-Markov over 100 s
    seed: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """Drives, their true poses (n, 3) at `STEP_S`, the true poles (p, 2) and a label for each; map frame."""

    drives: tuple[Drive, ...]
    poses: tuple[Floats, ...]
    pole_m: Floats
    anchors: tuple[AnchorLabelled, ...]


def poles(seed: int) -> Floats:
    """Poles (p, 2) on both sides of the road around the block; the last two are 1.5 m apart."""
    rng = np.random.default_rng(seed)
    found: list[Floats] = []
    while len(found) < 40:
        around = rng.uniform(0.0, 2.0 * math.pi)
        pole = _road(np.array([around]))[0] + rng.choice([-7.0, 7.0]) * _outward(around) + rng.normal(0.0, 0.7, 2)
        if all(np.hypot(*(pole - other)) > 3.5 for other in found):
            found.append(pole)
    return np.array([*found, found[-1] + (1.5, 0.0)])


def _road(around_rad: Floats) -> Floats:
    """Points (n, 2) of the road at angles (n,): an oval of about 400 m."""
    return CENTRE_M + np.column_stack([80.0 * np.cos(around_rad), 50.0 * np.sin(around_rad)])


def _outward(around_rad: float) -> Floats:
    normal = np.array([50.0 * math.cos(around_rad), 80.0 * math.sin(around_rad)])
    outward: Floats = normal / np.hypot(*normal)
    return outward


def _driven(lap: Lap) -> Floats:
    """True base poses (n, 3) every `STEP_S`."""
    time_s = np.arange(0.0, lap.duration_s, STEP_S)
    dense = np.linspace(0.0, 2.0 * math.pi * 4.0, 40_000) + lap.begin_rad
    point = _road(dense)
    along_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(point, axis=0).T))])
    wanted_m = lap.speed_mps * time_s * FRAME.point_scale
    heading = np.unwrap(np.arctan2(50.0 * np.cos(dense), -80.0 * np.sin(dense)))
    return np.column_stack([np.interp(wanted_m, along_m, column) for column in (*point.T, heading)])


def _drive(lap: Lap, pose: Floats, pole_m: Floats) -> Drive:
    rng = np.random.default_rng(lap.seed)
    stamp_ns = START_NS + np.round(np.arange(len(pose)) * STEP_S * 1e9).astype(np.int64)
    yaw_rate = np.gradient(pose[:, 2], STEP_S)
    count = len(pose)
    return Drive(
        vehicle=lap.vehicle,
        boot_id="boot",
        described=VehicleDescribed(
            vehicle=lap.vehicle,
            antenna_x_m=float(ANTENNA_M[0]),
            antenna_y_m=float(ANTENNA_M[1]),
            landmark_sensor_x_m=float(SENSOR_M[0]),
        ),
        wheels=WheelSeries(
            stamp_ns=stamp_ns,
            speed_mps=lap.speed_mps / lap.speed_scale + rng.normal(0.0, 0.03, count),
            steering_rad=np.full(count, np.nan),
            yaw_rate_radps=np.full(count, np.nan),
        ),
        imu=ImuSeries(stamp_ns=stamp_ns, yaw_rate_radps=yaw_rate - lap.yaw_bias_radps + rng.normal(0.0, 0.003, count)),
        fixes=_fixes(lap, stamp_ns[::20], pose[::20], rng),
        detections=_detections(stamp_ns[::10], pose[::10], pole_m, rng),
    )


def _fixes(lap: Lap, stamp_ns: Ints, pose: Floats, rng: np.random.Generator) -> FixSeries:
    """One fix a second."""
    count, decay = len(pose), math.exp(-1.0 / 100.0)
    slow = rng.normal(0.0, lap.slow_m, (count, 2))
    for row in range(1, count):
        slow[row] = decay * slow[row - 1] + math.sqrt(1.0 - decay**2) * slow[row]
    antenna_m = transform_points(pose, np.broadcast_to(ANTENNA_M, (count, 2)))
    lat_deg, lon_deg = wgs84_from_map_points(antenna_m + slow + rng.normal(0.0, lap.white_m, (count, 2)), FRAME)
    return FixSeries(
        stamp_ns=stamp_ns,
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        sigma_m=np.full(count, np.nan),
        sequence=np.arange(count, dtype=np.int64),
    )


def _detections(stamp_ns: Ints, pose: Floats, pole_m: Floats, rng: np.random.Generator) -> DetectionSeries:
    """Two sweeps a second see every pole within reach, range within 0.1 m and bearing within 0.005 rad."""
    sensor = transform_points(pose, np.broadcast_to(SENSOR_M, (len(pose), 2)))
    ray = (pole_m[None, :, :] - sensor[:, None, :]) / FRAME.point_scale
    range_m = np.hypot(ray[..., 0], ray[..., 1])
    sweep, pole = np.nonzero(range_m < REACH_M)
    bearing = np.arctan2(ray[..., 1], ray[..., 0])[sweep, pole] - pose[sweep, 2]
    count = len(sweep)
    return DetectionSeries(
        stamp_ns=stamp_ns[sweep],
        range_m=range_m[sweep, pole] + rng.normal(0.0, 0.1, count),
        bearing_rad=wrap_angles_rad(bearing + rng.normal(0.0, 0.005, count)),
        diameter_m=np.full(count, 0.2),
        kind=("pole",) * count,
        signature=("",) * count,
        sequence=sweep.astype(np.int64),
    )


def _label(name: str, place_m: Floats, image: str) -> AnchorLabelled:
    lat_deg, lon_deg = wgs84_from_map_points(place_m[None, :], FRAME)
    return AnchorLabelled(
        anchor=name,
        lat_deg=float(lat_deg[0]),
        lon_deg=float(lon_deg[0]),
        sigma_m=LABEL_SIGMA_M,
        image=image,
        image_sigma_m=IMAGE_SIGMA_M,
        kind="pole",
        signature="",
        source_crs="EPSG:4326",
        operation="",
    )


def labelled(pole_m: Floats, *, shift_m: Floats, seed: int = 5) -> tuple[AnchorLabelled, ...]:
    """A label for each pole in the image it lies in, east or west of the block's middle; shift_m (2, 2) by image."""
    noise = np.random.default_rng(seed).normal(0.0, LABEL_SIGMA_M, pole_m.shape)
    image = (pole_m[:, 0] < CENTRE_M[0]).astype(np.int64)
    place = pole_m + noise + shift_m[image]
    return tuple(_label(f"a{row}", place[row], IMAGES[image[row]]) for row in range(len(pole_m)))


def mismatched(world: World, share: float, *, seed: int = 3) -> tuple[AnchorLabelled, ...]:
    """The world's labels, a share of them moved onto other poles' places or well beside their own."""
    rng = np.random.default_rng(seed)
    wrong = rng.choice(len(world.anchors), round(share * len(world.anchors)), replace=False)
    angle = rng.uniform(0.0, 2.0 * math.pi, len(wrong))
    aside_m = rng.uniform(1.0, 10.0, len(wrong))
    anchors = list(world.anchors)
    for row, way, far_m in zip(wrong, angle, aside_m, strict=True):
        moved = _label("", world.pole_m[row] + far_m * np.array([math.cos(way), math.sin(way)]), "")
        anchors[row] = replace(anchors[row], lat_deg=moved.lat_deg, lon_deg=moved.lon_deg)
    return tuple(anchors)


def world(*laps: Lap, seed: int = 1) -> World:
    """A world driven by these laps, its images off by 0.3 m and less."""
    pole_m = poles(seed)
    poses = tuple(_driven(lap) for lap in laps)
    return World(
        drives=tuple(_drive(lap, pose, pole_m) for lap, pose in zip(laps, poses, strict=True)),
        poses=poses,
        pole_m=pole_m,
        anchors=labelled(pole_m, shift_m=np.array([[0.3, -0.1], [-0.2, 0.2]])),
    )
