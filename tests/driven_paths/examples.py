"""Seeded drives along a path that is known exactly, with errors that are known by name."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.drives import NO_DETECTIONS, Drive, FixSeries, ImuSeries, WheelSeries
from trigpoint.events.observed import VehicleDescribed
from trigpoint.geodesy.poses import transform_points
from trigpoint.geodesy.positions import GridPosition
from trigpoint.geodesy.projection import MapFrame, pin_map_frame, wgs84_from_map_points

Floats = NDArray[np.float64]

FRAME: MapFrame = pin_map_frame(crs="EPSG:32756", origin=GridPosition(332_000.0, 6_248_000.0))
START_NS = 1_700_000_000_000_000_000
STEP_S = 0.1  # of wheels and IMU
WHEELBASE_M = 2.5
ANTENNA_M = np.array([1.5, 0.4])


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """How a test drives and what its sensors get wrong. Fixes come once a second."""

    duration_s: float = 200.0
    speed_mps: float = 6.0
    turn_radps: float = 0.15  # amplitude of a slow swing from left to right
    heading_rad: float = 0.7
    speed_scale: float = 1.0  # true speed over measured speed
    steering_scale: float = 1.0  # true steering over measured steering
    yaw_bias_radps: float = 0.0
    white_m: float = 1.0
    declared_m: float = 2.0
    turns_by: str = "imu"  # "imu", "steering", "wheels" or "nothing"
    seed: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Driven:
    """A drive, its true poses (n, 3) at `pose_s` (n,) seconds after the start, and its frame."""

    drive: Drive
    pose_s: Floats
    pose: Floats

    def fix_s(self) -> Floats:
        """Seconds of each fix after the start."""
        return np.asarray((self.drive.fixes.stamp_ns - START_NS) * 1e-9, dtype=np.float64)

    def pose_at(self, stamp_ns: NDArray[np.int64]) -> Floats:
        """True poses (m, 3) at stamps."""
        at_s = (stamp_ns - START_NS) * 1e-9
        return np.column_stack([np.interp(at_s, self.pose_s, column) for column in self.pose.T])

    def with_shift(self, shift_m: Floats, chosen: NDArray[np.bool_]) -> "Driven":
        """The same drive with its chosen fixes shifted: by (2,) or each by its own (m, 2), metres east and north."""
        lat_deg, lon_deg = self.drive.fixes.lat_deg.copy(), self.drive.fixes.lon_deg.copy()
        antenna_m = transform_points(self.pose_at(self.drive.fixes.stamp_ns), ANTENNA_M[None, :])
        lat_deg[chosen], lon_deg[chosen] = wgs84_from_map_points(antenna_m[chosen] + shift_m, FRAME)
        return replace(
            self, drive=replace(self.drive, fixes=replace(self.drive.fixes, lat_deg=lat_deg, lon_deg=lon_deg))
        )

    def with_fixes(self, chosen: NDArray[np.bool_]) -> "Driven":
        """The same drive with the chosen fixes only."""
        return replace(self, drive=replace(self.drive, fixes=chosen_fixes(self.drive.fixes, chosen)))


def chosen_fixes(fixes: FixSeries, chosen: NDArray[np.bool_]) -> FixSeries:
    """The chosen ones of a series of fixes."""
    return FixSeries(
        stamp_ns=fixes.stamp_ns[chosen],
        lat_deg=fixes.lat_deg[chosen],
        lon_deg=fixes.lon_deg[chosen],
        sigma_m=fixes.sigma_m[chosen],
        sequence=fixes.sequence[chosen],
    )


def driven(course: Course) -> Driven:
    """The drive of a course, and where it really went."""
    rng = np.random.default_rng(course.seed)
    time_s = np.arange(0.0, course.duration_s, STEP_S)
    yaw_rate_radps = course.turn_radps * np.sin(0.08 * time_s) * (course.speed_mps > 0.0)
    heading_rad = course.heading_rad + np.concatenate([[0.0], np.cumsum(yaw_rate_radps[1:]) * STEP_S])
    middle_rad = heading_rad[1:] - 0.5 * yaw_rate_radps[1:] * STEP_S
    way_m = course.speed_mps * STEP_S * FRAME.point_scale
    x_m = 500.0 + np.concatenate([[0.0], np.cumsum(way_m * np.cos(middle_rad))])
    y_m = 500.0 + np.concatenate([[0.0], np.cumsum(way_m * np.sin(middle_rad))])
    pose = np.column_stack([x_m, y_m, heading_rad])
    drive = Drive(
        vehicle="car",
        boot_id="boot",
        described=_described(),
        wheels=_wheels(course, time_s, yaw_rate_radps),
        imu=_imu(course, time_s, yaw_rate_radps),
        fixes=_fixes(course, time_s, pose, rng),
        detections=NO_DETECTIONS,
    )
    return Driven(drive=drive, pose_s=time_s, pose=pose)


def _described() -> VehicleDescribed:
    return VehicleDescribed(
        vehicle="car", wheelbase_m=WHEELBASE_M, antenna_x_m=float(ANTENNA_M[0]), antenna_y_m=float(ANTENNA_M[1])
    )


def _stamps(time_s: Floats) -> NDArray[np.int64]:
    return START_NS + np.round(time_s * 1e9).astype(np.int64)


def _wheels(course: Course, time_s: Floats, yaw_rate_radps: Floats) -> WheelSeries:
    speed_mps = np.full(len(time_s), course.speed_mps)
    steering_rad = np.full(len(time_s), np.nan)
    wheel_yaw_rate = np.full(len(time_s), np.nan)
    if course.turns_by == "steering":
        steering_rad = np.arctan(yaw_rate_radps * WHEELBASE_M / course.speed_mps) / course.steering_scale
    if course.turns_by == "wheels":
        wheel_yaw_rate = yaw_rate_radps
    return WheelSeries(
        stamp_ns=_stamps(time_s),
        speed_mps=speed_mps / course.speed_scale,
        steering_rad=steering_rad,
        yaw_rate_radps=wheel_yaw_rate,
    )


def _imu(course: Course, time_s: Floats, yaw_rate_radps: Floats) -> ImuSeries:
    if course.turns_by != "imu":
        return ImuSeries(stamp_ns=np.zeros(0, dtype=np.int64), yaw_rate_radps=np.zeros(0))
    return ImuSeries(stamp_ns=_stamps(time_s), yaw_rate_radps=yaw_rate_radps - course.yaw_bias_radps)


def _fixes(course: Course, time_s: Floats, pose: Floats, rng: np.random.Generator) -> FixSeries:
    every = round(1.0 / STEP_S)
    antenna_m = transform_points(pose[::every], ANTENNA_M[None, :])
    lat_deg, lon_deg = wgs84_from_map_points(antenna_m + rng.normal(0.0, course.white_m, antenna_m.shape), FRAME)
    return FixSeries(
        stamp_ns=_stamps(time_s[::every]),
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        sigma_m=np.full(len(lat_deg), course.declared_m),
        sequence=np.arange(len(lat_deg), dtype=np.int64),
    )
