"""How a sweep of points is written as a foxglove.PointCloud, and read from one, whoever laid it out."""

from collections.abc import Mapping

import numpy as np
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from numpy.typing import NDArray

from trigpoint.errors import EventRejected
from trigpoint.events.packed_points import NS_PER_S, UNDECODABLE, PackedField, unpacked_points
from trigpoint.events.scanned import PointsScanned

Floats = NDArray[np.float64]

POINT = np.dtype([("xyz", "<f4", (3,)), ("intensity", "<f4"), ("offset_ns", "<i4"), ("ring", "<u2")])
"""What is written of one point, 22 bytes: the three numbers of `xyz` are the fields x, y and z."""

NUMBER_TYPES: Mapping[int, str] = {
    PackedElementField.UINT8: "<u1",
    PackedElementField.INT8: "<i1",
    PackedElementField.UINT16: "<u2",
    PackedElementField.INT16: "<i2",
    PackedElementField.UINT32: "<u4",
    PackedElementField.INT32: "<i4",
    PackedElementField.FLOAT32: "<f4",
    PackedElementField.FLOAT64: "<f8",
}
WRITTEN_FIELDS = (
    PackedElementField(name="x", offset=0, type=PackedElementField.FLOAT32),
    PackedElementField(name="y", offset=4, type=PackedElementField.FLOAT32),
    PackedElementField(name="z", offset=8, type=PackedElementField.FLOAT32),
    PackedElementField(name="intensity", offset=12, type=PackedElementField.FLOAT32),
    PackedElementField(name="offset_ns", offset=16, type=PackedElementField.INT32),
    PackedElementField(name="ring", offset=20, type=PackedElementField.UINT16),
)
NO_ROTATION = (0.0, 0.0, 0.0, 1.0)


def cloud_message(event: PointsScanned) -> PointCloud:
    """The sweep as a message: `frame_id` is the sensor, `pose` the sensor in the base frame.

    Raises EventRejected, "unencodable", for an array of another type or shape.
    """
    count = len(event.point_m)
    _require("point_m", event.point_m, np.float32, (count, 3))
    _require("intensity", event.intensity, np.float32, (count,))
    _require("offset_ns", event.offset_ns, np.int32, (count,))
    _require("ring", event.ring, np.uint16, (count,))
    _require("sensor_position_m", event.sensor_position_m, np.float64, (3,))
    _require("sensor_orientation", event.sensor_orientation, np.float64, (4,))
    rows = np.empty(count, dtype=POINT)
    rows["xyz"], rows["intensity"] = event.point_m, event.intensity
    rows["offset_ns"], rows["ring"] = event.offset_ns, event.ring
    message = PointCloud(frame_id=event.sensor, point_stride=POINT.itemsize, fields=WRITTEN_FIELDS, data=rows.tobytes())
    position, orientation = message.pose.position, message.pose.orientation
    position.x, position.y, position.z = event.sensor_position_m.tolist()
    orientation.x, orientation.y, orientation.z, orientation.w = event.sensor_orientation.tolist()
    return message


def cloud_event(message: PointCloud) -> PointsScanned:
    """The sweep a message holds, in whatever layout; without a pose, or one of its parts, the sensor is at the base.

    Raises EventRejected, "undecodable", as `unpacked_points` does.
    """
    stamp_ns = message.timestamp.seconds * NS_PER_S + message.timestamp.nanos if message.HasField("timestamp") else None
    fields = [_packed_field(field) for field in message.fields]
    points = unpacked_points(fields, message.data, stride=message.point_stride, stamp_ns=stamp_ns)
    position, orientation = message.pose.position, message.pose.orientation
    turned = (orientation.x, orientation.y, orientation.z, orientation.w)
    return PointsScanned(
        sensor=message.frame_id,
        sensor_position_m=np.array((position.x, position.y, position.z)),
        sensor_orientation=np.array(turned if message.pose.HasField("orientation") else NO_ROTATION),
        point_m=points.point_m,
        intensity=points.intensity,
        offset_ns=points.offset_ns,
        ring=points.ring,
    )


def _packed_field(field: PackedElementField) -> PackedField:
    kind = NUMBER_TYPES.get(field.type)
    if kind is None:
        raise EventRejected(UNDECODABLE, f"field {field.name!r} has type {field.type}: 1 to {max(NUMBER_TYPES)} known")
    return PackedField(field.name, field.offset, np.dtype(kind))


def _require(name: str, array: NDArray[np.generic], kind: type[np.generic], shape: tuple[int, ...]) -> None:
    if array.dtype != kind or array.shape != shape:
        raise EventRejected(
            "unencodable",
            f"{name} is {array.dtype} of shape {array.shape}, expected {np.dtype(kind)} of shape {shape}",
        )
