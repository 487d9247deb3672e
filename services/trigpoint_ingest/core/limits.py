"""What a measurement can be: anything outside is a fault of the sensor or of the message, not of the world."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass

from trigpoint.errors import EventRejected, FrameRefused
from trigpoint.events.observed import (
    GnssFixReceived,
    ImuMeasured,
    LandmarkDetection,
    LandmarksDetected,
    Observed,
    VehicleDescribed,
    WheelPairMeasured,
    WheelSpeedMeasured,
)
from trigpoint.events.scanned import PointsScanned
from trigpoint.geodesy.poses import wrap_angle_rad
from trigpoint_ingest.core.framing import frame_of_description
from trigpoint_ingest.core.sweep_limits import sweep_within_limits

LATITUDE_LIMIT_DEG = 90.0
LONGITUDE_LIMIT_DEG = 180.0
HEIGHT_LOWEST_M, HEIGHT_HIGHEST_M = -500.0, 10_000.0  # shore of the Dead Sea -430 m, highest roads below 6,000 m
SIGMA_SMALLEST_M, SIGMA_LARGEST_M = 1e-4, 1e6  # a zero would be infinite information
SPEED_LIMIT_MPS = 100.0  # 360 km/h
STEERING_LIMIT_RAD = math.pi / 2.0  # a wheel across the vehicle
YAW_RATE_LIMIT_RADPS = 35.0  # 2,000 degrees/s: the widest range of common MEMS gyroscopes
ACCELERATION_LIMIT_MPS2 = 160.0  # 16 g: the widest range of common MEMS accelerometers
RANGE_LIMIT_M = 1000.0  # beyond the reach of vehicle lidars
BEARING_LIMIT_RAD = 2.0 * math.pi  # one turn either way is wrapped, more is a fault
DIAMETER_LIMIT_M = 50.0
DETECTIONS_LIMIT = 10_000  # in one sweep
TEXT_LIMIT = 200  # characters of a name or a kind
LENGTH_LIMIT_M = 50.0  # no sensor is farther from the base of its vehicle
GRID_LIMIT_M = 5e7  # no projected coordinate on Earth is larger

UNDECODABLE = "undecodable"
NOT_FINITE = "not finite"
OUT_OF_RANGE = "out of range"
UNKNOWN_CRS = "unknown crs"


@dataclass(frozen=True, slots=True)
class FieldLimit:
    """A field's closed interval, in the unit its name ends with; `or_nan` where NaN says "not measured"."""

    name: str
    lowest: float
    highest: float
    or_nan: bool = False


def _within(name: str, limit: float, *, or_nan: bool = False) -> FieldLimit:
    return FieldLimit(name, -limit, limit, or_nan)


LIMITS: Mapping[type, tuple[FieldLimit, ...]] = {
    VehicleDescribed: (
        FieldLimit("wheelbase_m", 0.0, LENGTH_LIMIT_M),
        FieldLimit("track_m", 0.0, LENGTH_LIMIT_M),
        _within("speed_wheel_y_m", LENGTH_LIMIT_M),
        _within("antenna_x_m", LENGTH_LIMIT_M),
        _within("antenna_y_m", LENGTH_LIMIT_M),
        _within("landmark_sensor_x_m", LENGTH_LIMIT_M),
        _within("landmark_sensor_y_m", LENGTH_LIMIT_M),
        _within("landmark_sensor_yaw_rad", BEARING_LIMIT_RAD),
        FieldLimit("landmark_sensor_range_m", 0.0, RANGE_LIMIT_M),
        _within("declared_origin_easting_m", GRID_LIMIT_M),
        _within("declared_origin_northing_m", GRID_LIMIT_M),
    ),
    WheelSpeedMeasured: (
        _within("speed_mps", SPEED_LIMIT_MPS),
        _within("steering_rad", STEERING_LIMIT_RAD, or_nan=True),
        _within("yaw_rate_radps", YAW_RATE_LIMIT_RADPS, or_nan=True),
    ),
    WheelPairMeasured: (_within("left_mps", SPEED_LIMIT_MPS), _within("right_mps", SPEED_LIMIT_MPS)),
    ImuMeasured: (
        _within("yaw_rate_radps", YAW_RATE_LIMIT_RADPS),
        _within("acceleration_x_mps2", ACCELERATION_LIMIT_MPS2, or_nan=True),
        _within("acceleration_y_mps2", ACCELERATION_LIMIT_MPS2, or_nan=True),
    ),
    GnssFixReceived: (
        _within("lat_deg", LATITUDE_LIMIT_DEG),
        _within("lon_deg", LONGITUDE_LIMIT_DEG),
        FieldLimit("height_m", HEIGHT_LOWEST_M, HEIGHT_HIGHEST_M, or_nan=True),
        FieldLimit("sigma_m", SIGMA_SMALLEST_M, SIGMA_LARGEST_M, or_nan=True),
    ),
    LandmarksDetected: (),
    PointsScanned: (),
    LandmarkDetection: (
        FieldLimit("range_m", 0.0, RANGE_LIMIT_M),
        _within("bearing_rad", BEARING_LIMIT_RAD),
        FieldLimit("diameter_m", 0.0, DIAMETER_LIMIT_M, or_nan=True),
    ),
}


def within_limits(event: Observed) -> Observed:
    """The event itself, bearings wrapped into [-pi, pi), infinite points NaN.

    Raises EventRejected with reason "not finite", "out of range" or "unknown crs", or as `sweep_within_limits` does.
    """
    _require_fields(event)
    if type(event) is LandmarksDetected:
        return _detections_within_limits(event)
    if type(event) is PointsScanned:
        _require_texts(sensor=event.sensor)
        return sweep_within_limits(event)
    if type(event) is VehicleDescribed:
        _require_description(event)
    if type(event) is GnssFixReceived and event.lat_deg == 0.0 and event.lon_deg == 0.0:
        raise EventRejected(OUT_OF_RANGE, "latitude and longitude exactly 0: what a receiver without a fix reports")
    return event


_INTERVALS = {
    kind: tuple((limit.name, limit.lowest, limit.highest, limit) for limit in limits) for kind, limits in LIMITS.items()
}


def _require_fields(event: Observed | LandmarkDetection) -> None:
    for name, lowest, highest, limit in _INTERVALS[type(event)]:
        value = getattr(event, name)
        if not lowest <= value <= highest and not (limit.or_nan and value != value):
            raise _refusal(event, limit, value)


def _refusal(event: Observed | LandmarkDetection, limit: FieldLimit, value: float) -> EventRejected:
    name = f"{type(event).__name__}.{limit.name}"
    if not math.isfinite(value):
        return EventRejected(NOT_FINITE, f"{name} is {value}: a finite number is needed")
    return EventRejected(OUT_OF_RANGE, f"{name} {value:.9g} is outside {limit.lowest:.9g} to {limit.highest:.9g}")


def _detections_within_limits(sweep: LandmarksDetected) -> LandmarksDetected:
    if len(sweep.detections) > DETECTIONS_LIMIT:
        raise EventRejected(OUT_OF_RANGE, f"{len(sweep.detections)} detections in a sweep, limit {DETECTIONS_LIMIT}")
    wrapped = False
    for detection in sweep.detections:
        _require_fields(detection)
        _require_texts(kind=detection.kind, signature=detection.signature)
        wrapped = wrapped or not -math.pi <= detection.bearing_rad < math.pi
    return _wrapped(sweep) if wrapped else sweep


def _wrapped(sweep: LandmarksDetected) -> LandmarksDetected:
    return LandmarksDetected(
        detections=tuple(
            dataclasses.replace(detection, bearing_rad=wrap_angle_rad(detection.bearing_rad))
            for detection in sweep.detections
        )
    )


def _require_texts(**texts: str) -> None:
    for name, text in texts.items():
        if len(text) > TEXT_LIMIT:
            raise EventRejected(OUT_OF_RANGE, f"{name} of {len(text)} characters, limit {TEXT_LIMIT}")


def _require_description(event: VehicleDescribed) -> None:
    _require_texts(vehicle=event.vehicle, software=event.software, declared_crs=event.declared_crs)
    _require_texts(landmark_sensor_model=event.landmark_sensor_model)
    if event.declared_crs:
        try:
            frame_of_description(event)
        except FrameRefused as error:
            raise EventRejected(UNKNOWN_CRS, str(error)) from error
