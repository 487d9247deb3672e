"""What vehicles measured, as they said it. Writer: ingest, after validation."""

from dataclasses import dataclass

from trigpoint.events.scanned import PointsScanned


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleDescribed:
    """A vehicle's geometry and sensors; first event of a drive. Positions in the base frame: x ahead, y left,
    origin at the middle of the rear axle (or of the turning axis).

    `steering` turns into yaw rate by `wheelbase_m` where wheels report steering; `track_m` where they report
    left and right. `speed_wheel_y_m` is where the wheel that measures speed runs. A wheelbase, track or
    range of 0 means unknown.
    `landmark_sensor_model` is "camera" where ranges come from the image (an error in proportion to the range, and
    depth rather than range), empty where they are measured, as by a lidar.
    `declared_crs` and `declared_origin_*` place a local metric frame when the source has no other reference
    (empty and 0 otherwise).
    """

    vehicle: str
    wheelbase_m: float = 0.0
    track_m: float = 0.0
    speed_wheel_y_m: float = 0.0
    antenna_x_m: float = 0.0
    antenna_y_m: float = 0.0
    landmark_sensor_x_m: float = 0.0
    landmark_sensor_y_m: float = 0.0
    landmark_sensor_yaw_rad: float = 0.0
    landmark_sensor_range_m: float = 0.0
    landmark_sensor_model: str = ""
    declared_crs: str = ""
    declared_origin_easting_m: float = 0.0
    declared_origin_northing_m: float = 0.0
    software: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelSpeedMeasured:
    """Speed of one wheel or of the base, with the steering angle or the yaw rate that goes with it, if any.

    NaN where the source has none. Steering and yaw rate positive to the left.
    """

    speed_mps: float
    steering_rad: float
    yaw_rate_radps: float


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelPairMeasured:
    """Speeds of the left and the right wheel of an axle."""

    left_mps: float
    right_mps: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuMeasured:
    """Yaw rate (positive to the left) and horizontal acceleration in the base frame (NaN where not measured)."""

    yaw_rate_radps: float
    acceleration_x_mps2: float
    acceleration_y_mps2: float


@dataclass(frozen=True, slots=True, kw_only=True)
class GnssFixReceived:
    """A receiver's position. `sigma_m` is the receiver's own 1-sigma per axis, NaN where it declares none."""

    lat_deg: float
    lon_deg: float
    height_m: float
    sigma_m: float


@dataclass(frozen=True, slots=True)
class LandmarkDetection:
    """One detection in the landmark sensor's frame: range, and bearing counter-clockwise from ahead.

    `signature` is the landmark's known identity, empty where unknown; a sighting of another vehicle has
    kind "vehicle" and that vehicle's name as signature. `diameter_m` NaN where not measured.
    """

    range_m: float
    bearing_rad: float
    kind: str
    signature: str
    diameter_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LandmarksDetected:
    """All landmark detections of one sensor sweep, possibly none."""

    detections: tuple[LandmarkDetection, ...]


Observed = (
    VehicleDescribed
    | WheelSpeedMeasured
    | WheelPairMeasured
    | ImuMeasured
    | GnssFixReceived
    | LandmarksDetected
    | PointsScanned
)


@dataclass(frozen=True, slots=True, kw_only=True)
class EventRefused:
    """A message that ingest did not accept, kept whole with the reason. Writer: ingest."""

    source: str
    reason: str
    detail: str
    schema_name: str
    payload: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class MapFramePinned:
    """The map's frame was fixed for good. Writer: ingest (first usable position, declared origin or anchor)."""

    crs: str
    origin_easting_m: float
    origin_northing_m: float
    declared_by: str
