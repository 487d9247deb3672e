"""Bags written by the library that reads them: small drives with a lidar, a receiver, an IMU and wheels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
START_NS = 1_700_000_000_000_000_000
DATATYPES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}

VELODYNE = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "ring", "time"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<u2", "<f4"],
        "offsets": [0, 4, 8, 12, 16, 18],
        "itemsize": 22,
    }
)
OUSTER = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "t", "reflectivity", "ring", "ambient", "range"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<u4", "<u2", "u1", "<u2", "<u4"],
        "offsets": [0, 4, 8, 16, 20, 24, 26, 28, 32],
        "itemsize": 48,
    }
)
LIVOX = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("offset_time", "<u4")])


@dataclass(frozen=True, slots=True, kw_only=True)
class Said:
    """One message of a bag: on which topic, of which type, what, and when it arrived."""

    topic: str
    kind: str
    message: Any
    arrived_ns: int


@dataclass(frozen=True, slots=True)
class Speaker:
    """Makes the messages of one ROS version."""

    version: int

    @property
    def _store(self) -> Any:
        return ROS1 if self.version == 1 else ROS2

    def made(self, kind: str, **values: Any) -> Any:
        """A message of a type, e.g. "std_msgs/msg/Header"."""
        return self._store.types[kind](**values)

    def header(self, frame: str, stamp_ns: int) -> Any:
        """A header; its sequence number is ROS 1's alone."""
        stamp = self.made("builtin_interfaces/msg/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
        own = {"seq": 0} if self.version == 1 else {}
        return self.made("std_msgs/msg/Header", stamp=stamp, frame_id=frame, **own)

    def vector(self, x: float, y: float, z: float) -> Any:
        """Three numbers."""
        return self.made("geometry_msgs/msg/Vector3", x=x, y=y, z=z)

    def cloud(self, rows: NDArray[np.void], *, stamp_ns: int = START_NS, frame: str = "lidar", **replaced: Any) -> Said:
        """A PointCloud2 of a structured array."""
        kinds = dict(rows.dtype.fields or {})
        fields = [
            self.made(
                "sensor_msgs/msg/PointField", name=name, offset=kind[1], datatype=DATATYPES[kind[0].str[1:]], count=1
            )
            for name, kind in kinds.items()
        ]
        values: dict[str, Any] = {
            "height": 1,
            "width": len(rows),
            "fields": fields,
            "is_bigendian": False,
            "point_step": rows.dtype.itemsize,
            "row_step": rows.nbytes,
            "data": np.frombuffer(rows.tobytes(), dtype=np.uint8),
            "is_dense": False,
        }
        kind_name = "sensor_msgs/msg/PointCloud2"
        message = self.made(kind_name, header=self.header(frame, stamp_ns), **(values | replaced))
        return Said(topic="/points", kind=kind_name, message=message, arrived_ns=stamp_ns + 100_000_000)

    def fix(self, stamp_ns: int = START_NS, *, status: int = 0, topic: str = "/fix", **replaced: Any) -> Said:
        """A NavSatFix with a sigma of 2 m."""
        known = self.made("sensor_msgs/msg/NavSatStatus", status=status, service=1)
        values: dict[str, Any] = {
            "latitude": -33.9,
            "longitude": 151.2,
            "altitude": 30.0,
            "position_covariance": np.array([4.0, 0, 0, 0, 1.0, 0, 0, 0, 9.0]),
            "position_covariance_type": 2,
        }
        kind = "sensor_msgs/msg/NavSatFix"
        message = self.made(kind, header=self.header("gps", stamp_ns), status=known, **(values | replaced))
        return Said(topic=topic, kind=kind, message=message, arrived_ns=stamp_ns)

    def imu(self, stamp_ns: int, *, rate: Sequence[float], force: Sequence[float]) -> Said:
        """An Imu."""
        kind = "sensor_msgs/msg/Imu"
        message = self.made(
            kind,
            header=self.header("imu", stamp_ns),
            orientation=self.made("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
            orientation_covariance=np.zeros(9),
            angular_velocity=self.vector(*rate),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=self.vector(*force),
            linear_acceleration_covariance=np.zeros(9),
        )
        return Said(topic="/imu", kind=kind, message=message, arrived_ns=stamp_ns)

    def mounting(self, child: str, parent: str, position: Sequence[float], turned: Sequence[float]) -> Said:
        """One transform on /tf_static."""
        transform = self.made(
            "geometry_msgs/msg/Transform",
            translation=self.vector(*position),
            rotation=self.made("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", turned, strict=True))),
        )
        stamped = self.made(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(parent, START_NS),
            child_frame_id=child,
            transform=transform,
        )
        kind = "tf2_msgs/msg/TFMessage"
        return Said(topic="/tf_static", kind=kind, message=self.made(kind, transforms=[stamped]), arrived_ns=START_NS)


def points(layout: "np.dtype[np.void]", count: int = 3, **columns: object) -> NDArray[np.void]:
    """Points (n,) of a layout, 1, 2, 3 m from the lidar where nothing else is said of them."""
    rows = np.zeros(count, dtype=layout)
    values: Mapping[str, object] = {"x": 1.0, "y": 2.0, "z": 3.0} | columns
    for name, value in values.items():
        rows[name] = value
    return rows


def written_bag(folder: Path, version: int, said: Sequence[Said]) -> Path:
    """A bag with the messages: a .bag of ROS 1, or a folder of ROS 2 with an .mcap."""
    kinds = {one.topic: one.kind for one in said}
    if version == 1:
        path = folder / "drive.bag"
        with Ros1Writer(path) as bag:
            topics1 = {topic: bag.add_connection(topic, kind, typestore=ROS1) for topic, kind in kinds.items()}
            for one in said:
                bag.write(topics1[one.topic], one.arrived_ns, bytes(ROS1.serialize_ros1(one.message, one.kind)))
        return path
    path = folder / "drive"
    with Ros2Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as mcap:
        topics2 = {topic: mcap.add_connection(topic, kind, typestore=ROS2) for topic, kind in kinds.items()}
        for one in said:
            mcap.write(topics2[one.topic], one.arrived_ns, bytes(ROS2.serialize_cdr(one.message, one.kind)))
    return path
