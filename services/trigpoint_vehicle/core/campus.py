"""A seeded campus: streets, landmarks, drives, aerial images, and the truth of all of it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.observed import GnssFixReceived, VehicleDescribed
from trigpoint.events.truth import Truth, TruthFixes, TruthLabel, TruthLandmark, TruthPath
from trigpoint.geodesy.poses import transform_points, wrap_angles_rad
from trigpoint.geodesy.positions import GridPosition
from trigpoint.geodesy.projection import MapFrame, pin_map_frame, wgs84_from_map_points
from trigpoint_vehicle.core.campus_settings import CampusSettings
from trigpoint_vehicle.core.imagery import Imagery, Labels, PolesSeen, read_labels, taken_imagery
from trigpoint_vehicle.core.motion import Motion, driven_line_m, motion_along, standing_motion
from trigpoint_vehicle.core.odometry import imu_readings, sampled_indices, stamps_ns, wheel_speeds
from trigpoint_vehicle.core.placement import PlacedLandmarks, placed_landmarks
from trigpoint_vehicle.core.receiver import fix_errors
from trigpoint_vehicle.core.recording import Conversion, Recording, Timed, boot_id_of, recording_of
from trigpoint_vehicle.core.streets import Streets, laid_streets, planned_routes_m, quadrangle_box_m
from trigpoint_vehicle.core.sweeps import CLUTTER, Sightings, sightings_along, sweep_events

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Progress = Callable[[int, int], object]

PASSED_EVERY = 10  # samples of a motion: under a metre

# Each part of the world draws from a stream of its own: changing one sensor leaves the others as they were.
STREETS, LANDMARKS, ROUTES, IMAGES, LABELS, LANE, WHEELS, IMU, GNSS, SWEEPS = range(10)


@dataclass(frozen=True, slots=True, kw_only=True)
class Campus:
    """Recordings as vehicles send them, and apart from them what is true.

    Positions in `landmarks`, `streets` and `motions` are metres of `frame` (grid metres from its origin).
    """

    frame: MapFrame
    recordings: tuple[Recording, ...]
    truth: Truth
    anchors: tuple[AnchorLabelled, ...]
    streets: Streets
    landmarks: PlacedLandmarks
    motions: tuple[Motion, ...]
    sightings: tuple[Sightings, ...]
    imagery: Imagery


def _stream(seed: int, part: int, vehicle_index: int = 0) -> np.random.Generator:
    return np.random.default_rng([seed, part, vehicle_index])


@dataclass(frozen=True, slots=True, kw_only=True)
class _World:
    seed: int
    settings: CampusSettings
    frame: MapFrame
    streets: Streets
    landmarks: PlacedLandmarks


@dataclass(frozen=True, slots=True, kw_only=True)
class _Driven:
    recording: Recording
    path: TruthPath
    fixes: TruthFixes
    motion: Motion
    sightings: Sightings


def _described(vehicle: str, settings: CampusSettings) -> VehicleDescribed:
    geometry = settings.vehicle
    return VehicleDescribed(
        vehicle=vehicle,
        wheelbase_m=geometry.wheelbase_m,
        track_m=geometry.track_m,
        antenna_x_m=geometry.antenna_x_m,
        antenna_y_m=geometry.antenna_y_m,
        landmark_sensor_x_m=geometry.landmark_sensor_x_m,
        landmark_sensor_y_m=geometry.landmark_sensor_y_m,
        landmark_sensor_range_m=settings.sweeps.range_max_m,
        declared_crs="" if settings.carried.gnss else settings.crs,
        declared_origin_easting_m=0.0 if settings.carried.gnss else settings.origin_easting_m,
        declared_origin_northing_m=0.0 if settings.carried.gnss else settings.origin_northing_m,
        software="trigpoint campus",
    )


def _over_ground(motion: Motion, scale: float) -> Motion:
    return replace(motion, speed_mps=motion.speed_mps / scale, acceleration_mps2=motion.acceleration_mps2 / scale)


def _point_on_vehicle_m(pose: Floats, x_m: float, y_m: float, scale: float) -> Floats:
    return transform_points(pose, scale * np.tile([x_m, y_m], (len(pose), 1)))


def _fixes(
    world: _World, motion: Motion, vehicle: str, *, index: int, first_stamp_ns: int
) -> tuple[list[Timed], TruthFixes]:
    settings, geometry = world.settings.gnss, world.settings.vehicle
    at = sampled_indices(motion, settings.rate_hz)
    stamps = stamps_ns(motion, at, first_stamp_ns)
    scale = world.frame.point_scale
    antenna_m = _point_on_vehicle_m(motion.pose[at], geometry.antenna_x_m, geometry.antenna_y_m, scale)
    errors = fix_errors(motion.time_s[at], settings, _stream(world.seed, GNSS, index))
    lat_deg, lon_deg = wgs84_from_map_points(antenna_m + errors.error_m, world.frame)
    sigma_m, height_m = settings.declared_sigma_m, settings.height_m
    timed: list[Timed] = [
        (stamp, GnssFixReceived(lat_deg=lat, lon_deg=lon, height_m=height_m, sigma_m=sigma_m))
        for stamp, lat, lon in zip(stamps.tolist(), lat_deg.tolist(), lon_deg.tolist(), strict=True)
    ]
    lat_deg, lon_deg = wgs84_from_map_points(antenna_m, world.frame)
    true = TruthFixes(vehicle=vehicle, stamp_ns=stamps, lat_deg=lat_deg, lon_deg=lon_deg, state=errors.state)
    return timed, true


def _sweeps(world: _World, motion: Motion, *, index: int, first_stamp_ns: int) -> tuple[list[Timed], Sightings]:
    settings, geometry = world.settings.sweeps, world.settings.vehicle
    at = sampled_indices(motion, settings.rate_hz)
    scale, pose = world.frame.point_scale, motion.pose[at]
    sensor_m = _point_on_vehicle_m(pose, geometry.landmark_sensor_x_m, geometry.landmark_sensor_y_m, scale)
    rng = _stream(world.seed, SWEEPS, index)
    sensor_pose = np.column_stack([sensor_m, pose[:, 2]])
    seen = sightings_along(sensor_pose, world.landmarks, settings, scale=scale, rng=rng)
    return sweep_events(stamps_ns(motion, at, first_stamp_ns), seen, world.landmarks, settings, rng), seen


def _true_path(world: _World, motion: Motion, vehicle: str, first_stamp_ns: int) -> TruthPath:
    at = sampled_indices(motion, world.settings.truth_rate_hz)
    lat_deg, lon_deg = wgs84_from_map_points(motion.pose[at, :2], world.frame)
    return TruthPath(
        vehicle=vehicle,
        stamp_ns=stamps_ns(motion, at, first_stamp_ns),
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        heading_rad=wrap_angles_rad(motion.pose[at, 2]),
    )


def _odometry(world: _World, motion: Motion, *, index: int, first_stamp_ns: int) -> list[Timed]:
    settings, timed = world.settings, list[Timed]()
    ground = _over_ground(motion, world.frame.point_scale)
    if settings.carried.wheels:
        wheel_rng, wheelbase_m = _stream(world.seed, WHEELS, index), settings.vehicle.wheelbase_m
        timed += wheel_speeds(
            ground, settings.wheels, wheelbase_m=wheelbase_m, first_stamp_ns=first_stamp_ns, rng=wheel_rng
        )
    if settings.carried.imu:
        imu_rng = _stream(world.seed, IMU, index)
        timed += imu_readings(ground, settings.imu, first_stamp_ns=first_stamp_ns, rng=imu_rng)
    return timed


def first_stamp_ns(settings: CampusSettings, vehicle_index: int) -> int:
    """When a vehicle sets off."""
    return round((settings.first_stamp_s + vehicle_index * settings.vehicle_interval_s) * 1e9)


def _driven(world: _World, motion: Motion, index: int) -> _Driven:
    settings, vehicle = world.settings, f"vehicle-{index + 1}"
    begin_ns = first_stamp_ns(settings, index)
    timed = _odometry(world, motion, index=index, first_stamp_ns=begin_ns)
    fixes, true_fixes = _fixes(world, motion, vehicle, index=index, first_stamp_ns=begin_ns)
    sweeps, seen = _sweeps(world, motion, index=index, first_stamp_ns=begin_ns)
    timed += fixes if settings.carried.gnss else []
    timed += sweeps if settings.carried.landmarks else []
    boot_id = boot_id_of(b"campus", str(world.seed).encode(), vehicle.encode(), repr(settings).encode())
    return _Driven(
        recording=recording_of(_described(vehicle, settings), timed, boot_id=boot_id),
        path=_true_path(world, motion, vehicle, begin_ns),
        fixes=true_fixes,
        motion=motion,
        sightings=seen,
    )


def _motion(seed: int, settings: CampusSettings, corner_m: Floats, index: int) -> Motion:
    rng = _stream(seed, LANE, index)
    if settings.route.plan == "standing":
        return standing_motion(corner_m, settings.route, settings.motion)
    return motion_along(driven_line_m(corner_m, settings.streets, rng), settings.motion, rng)


def _seen_counts(world: _World, driven: list[_Driven]) -> Ints:
    landmark = np.concatenate([drive.sightings.landmark for drive in driven])
    return np.bincount(landmark[landmark != CLUTTER], minlength=len(world.landmarks.name))


def _labels(world: _World, driven: list[_Driven], imagery: Imagery) -> Labels:
    streets, poles = world.settings.streets, world.landmarks.kind.count("pole")
    seen = PolesSeen(
        pole_m=world.landmarks.position_m[:poles],
        sightings=_seen_counts(world, driven)[:poles],
        quadrangle_m=quadrangle_box_m(world.streets, streets.quadrangle_margin_m),
        extent_m=(streets.width_m, streets.height_m),
    )
    return read_labels(seen, imagery, world.settings.imagery, _stream(world.seed, LABELS))


def _anchors(world: _World, labels: Labels, imagery: Imagery) -> tuple[AnchorLabelled, ...]:
    settings = world.settings.imagery
    lat_deg, lon_deg = wgs84_from_map_points(labels.position_m, world.frame)
    columns = zip(labels.landmark.tolist(), labels.image.tolist(), lat_deg.tolist(), lon_deg.tolist(), strict=True)
    return tuple(
        AnchorLabelled(
            anchor=f"label-{number:02d}",
            lat_deg=lat,
            lon_deg=lon,
            sigma_m=settings.label_sigma_m,
            image=imagery.image[image],
            image_sigma_m=settings.offset_sigma_m,
            kind=world.landmarks.kind[landmark],
            signature=world.landmarks.name[landmark] if settings.known_signatures else "",
            source_crs="EPSG:4326",
            operation="none",
        )
        for number, (landmark, image, lat, lon) in enumerate(columns)
    )


def _truth(world: _World, driven: list[_Driven], labels: Labels) -> Truth:
    landmarks = world.landmarks
    lat_deg, lon_deg = (column.tolist() for column in wgs84_from_map_points(landmarks.position_m, world.frame))
    signatures = landmarks.name if world.settings.sweeps.known_signatures else ("",) * len(landmarks.name)
    return Truth(
        paths=tuple(drive.path for drive in driven),
        fixes=tuple(drive.fixes for drive in driven) if world.settings.carried.gnss else (),
        landmarks=tuple(
            TruthLandmark(landmark=name, lat_deg=lat, lon_deg=lon, signature=signature)
            for name, lat, lon, signature in zip(landmarks.name, lat_deg, lon_deg, signatures, strict=True)
        ),
        labels=tuple(
            TruthLabel(anchor=f"label-{n:02d}", landmark=landmarks.name[i], lat_deg=lat_deg[i], lon_deg=lon_deg[i])
            for n, i in enumerate(labels.landmark.tolist())
        ),
    )


def in_silence(done: int, total: int) -> None:
    """Progress for nobody."""


def simulate_campus(seed: int, settings: CampusSettings, *, progress: Progress = in_silence) -> Campus:
    """The campus of a seed: the same seed and settings give the same events and the same truth, bit for bit.

    `progress` gets vehicles driven and vehicles there are, after each.
    Raises InputError for settings that cannot be met.
    """
    origin = GridPosition(settings.origin_easting_m, settings.origin_northing_m)
    frame = pin_map_frame(crs=settings.crs, origin=origin)
    streets = laid_streets(settings.streets, _stream(seed, STREETS))
    routes = planned_routes_m(streets, settings.route, vehicles=settings.vehicles, rng=_stream(seed, ROUTES))
    motions = [_motion(seed, settings, corner_m, index) for index, corner_m in enumerate(routes)]
    passed_m = np.vstack([motion.pose[::PASSED_EVERY, :2] for motion in motions])
    landmarks = placed_landmarks(streets, passed_m, settings.landmarks, _stream(seed, LANDMARKS))
    world = _World(seed=seed, settings=settings, frame=frame, streets=streets, landmarks=landmarks)
    driven = []
    for index, motion in enumerate(motions):
        driven.append(_driven(world, motion, index))
        progress(index + 1, len(motions))
    imagery = taken_imagery(settings.imagery, _stream(seed, IMAGES))
    labels = _labels(world, driven, imagery)
    return Campus(
        frame=frame,
        recordings=tuple(drive.recording for drive in driven),
        truth=_truth(world, driven, labels),
        anchors=_anchors(world, labels, imagery),
        streets=streets,
        landmarks=landmarks,
        motions=tuple(drive.motion for drive in driven),
        sightings=tuple(drive.sightings for drive in driven),
        imagery=imagery,
    )


def conversion_of(campus: Campus) -> Conversion:
    """A campus in the form the importers give."""
    return Conversion(recordings=campus.recordings, truth=campus.truth, anchors=campus.anchors)
