"""ROS messages as observations. A message is whatever object has the fields its ROS type defines."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import EventRejected, InputError
from trigpoint.events.observed import GnssFixReceived, ImuMeasured, WheelSpeedMeasured
from trigpoint.events.packed_points import UNDECODABLE, PackedField, unpacked_points
from trigpoint.events.scanned import PointsScanned
from trigpoint_vehicle.core.mountings import AT_BASE, Mounting
from trigpoint_vehicle.core.returns import returned_points

Floats = NDArray[np.float64]

NS_PER_S = 1_000_000_000
NO_FIX, COVARIANCE_UNKNOWN = -1, 0  # NavSatStatus.STATUS_NO_FIX, NavSatFix.COVARIANCE_TYPE_UNKNOWN
LEVEL_COS = math.cos(math.radians(10.0))  # of the angle to the vertical, within which an IMU's x and y are horizontal
GRAVITY_LEAST_MPS2, GRAVITY_MOST_MPS2 = 8.0, 11.6  # of the mean specific force of a drive: 9.8 and what it accelerates
FRAMES_DEEP = 32  # transforms between a sensor and the base
POINT_FIELD_TYPES: Mapping[int, str] = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


def stamp_of(message: Any, arrived_ns: int) -> int:
    """The header's stamp in ns; when the message arrived where the header has none (0)."""
    stamp = message.header.stamp
    stamp_ns = int(stamp.sec) * NS_PER_S + int(stamp.nanosec)
    return stamp_ns or arrived_ns


def fix_event(message: Any) -> GnssFixReceived:
    """A NavSatFix's position, sigma of the worse horizontal axis. Raises EventRejected, "no fix"."""
    lat_deg, lon_deg = float(message.latitude), float(message.longitude)
    if message.status.status == NO_FIX or math.isnan(lat_deg) or math.isnan(lon_deg):
        raise EventRejected("no fix", f"status {message.status.status} at {lat_deg:g}, {lon_deg:g} degrees")
    variance_m2 = max(float(message.position_covariance[0]), float(message.position_covariance[4]))
    known = message.position_covariance_type != COVARIANCE_UNKNOWN and variance_m2 > 0.0
    sigma_m = math.sqrt(variance_m2) if known else math.nan
    return GnssFixReceived(lat_deg=lat_deg, lon_deg=lon_deg, height_m=float(message.altitude), sigma_m=sigma_m)


def wheel_event(message: Any) -> WheelSpeedMeasured:
    """An Odometry's speed ahead and its rate of turn."""
    twist = message.twist.twist
    return WheelSpeedMeasured(
        speed_mps=float(twist.linear.x), steering_rad=math.nan, yaw_rate_radps=float(twist.angular.z)
    )


def specific_force(message: Any) -> tuple[float, float, float]:
    """An Imu's linear acceleration, m/s², gravity included."""
    force = message.linear_acceleration
    return float(force.x), float(force.y), float(force.z)


def up_in_imu(specific_force_mps2: Floats) -> Floats:
    """The vertical (3,) in the IMU's own axes, from the mean of its specific forces (n, 3): however it is mounted.

    Raises InputError where that mean is not gravity: gravity was taken out, or nothing was measured.
    """
    finite = specific_force_mps2[np.isfinite(specific_force_mps2).all(axis=1)]
    mean_mps2 = finite.mean(axis=0) if len(finite) else np.zeros(3)
    length_mps2 = float(np.linalg.norm(mean_mps2))
    if not GRAVITY_LEAST_MPS2 <= length_mps2 <= GRAVITY_MOST_MPS2:
        raise InputError(
            f"the IMU's mean acceleration is {length_mps2:.3g} m/s² of {len(finite)} messages: between "
            f"{GRAVITY_LEAST_MPS2:g} and {GRAVITY_MOST_MPS2:g} tells which way is up; name the topics wanted without it"
        )
    up: Floats = mean_mps2 / length_mps2
    return up


def imu_event(message: Any, up: Floats) -> ImuMeasured:
    """An Imu's rate of turn about the vertical; its horizontal accelerations where it is mounted level, else NaN."""
    rate = message.angular_velocity
    x_mps2, y_mps2, _ = specific_force(message)
    level = up[2] >= LEVEL_COS
    return ImuMeasured(
        yaw_rate_radps=float(up @ np.array([rate.x, rate.y, rate.z], dtype=np.float64)),
        acceleration_x_mps2=x_mps2 if level else math.nan,
        acceleration_y_mps2=y_mps2 if level else math.nan,
    )


def sweep_event(message: Any, mounting: Mounting, *, stamp_ns: int) -> PointsScanned:
    """A PointCloud2 in the layout of whatever driver wrote it. Raises EventRejected, "undecodable"."""
    order = ">" if message.is_bigendian else "<"
    fields = [_field(field, order) for field in message.fields if field.count <= 1]
    points = unpacked_points(fields, _points_data(message), stride=int(message.point_step), stamp_ns=stamp_ns)
    return PointsScanned(
        sensor=message.header.frame_id,
        sensor_position_m=mounting.position_m,
        sensor_orientation=mounting.orientation,
        point_m=returned_points(points.point_m),
        intensity=points.intensity,
        offset_ns=points.offset_ns,
        ring=points.ring,
    )


def _field(field: Any, order: str) -> PackedField:
    kind = POINT_FIELD_TYPES.get(int(field.datatype))
    if kind is None:
        raise EventRejected(UNDECODABLE, f"field {field.name!r} has datatype {field.datatype}: 1 to 8 are known")
    return PackedField(str(field.name), int(field.offset), np.dtype(order + kind))


def _points_data(message: Any) -> bytes:
    """The points one behind the other, without what rows are filled up with."""
    height, width = int(message.height), int(message.width)
    row_step, stride, data = int(message.row_step), int(message.point_step), bytes(message.data)
    if stride < 1 or row_step < width * stride or len(data) != row_step * height:
        raise EventRejected(
            UNDECODABLE,
            f"{len(data)} bytes in {height} rows of {row_step} bytes, {width} points of {stride} bytes each",
        )
    if row_step == width * stride:
        return data
    return np.frombuffer(data, dtype=np.uint8).reshape(height, row_step)[:, : width * stride].tobytes()


@dataclass(frozen=True, slots=True)
class FrameTransform:
    """`T_parent_child`: where a frame is in its parent."""

    parent: str
    child: str
    mounting: Mounting


def transforms_of(message: Any) -> list[FrameTransform]:
    """What a TFMessage says of frames."""
    return [_transform(one) for one in message.transforms]


def _transform(stamped: Any) -> FrameTransform:
    shift, turn = stamped.transform.translation, stamped.transform.rotation
    mounting = Mounting(np.array([shift.x, shift.y, shift.z]), np.array([turn.x, turn.y, turn.z, turn.w]))
    return FrameTransform(_name(stamped.header.frame_id), _name(stamped.child_frame_id), mounting)


def _name(frame: str) -> str:
    return frame.removeprefix("/")


def mounting_in(base: str, frame: str, transforms: Mapping[str, FrameTransform]) -> Mounting | None:
    """A frame in the base frame, by transforms named after their child; None where none lead there."""
    mounting, at = AT_BASE, _name(frame)
    for _ in range(FRAMES_DEEP):
        if at == base:
            return mounting
        if at not in transforms:
            return None
        step = transforms[at]
        mounting, at = step.mounting.compose(mounting), step.parent
    return None
