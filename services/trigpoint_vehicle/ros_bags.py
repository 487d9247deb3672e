"""ROS bags, of ROS 1 and 2, read message by message: the only home of the library that reads them."""

import contextlib
import struct
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.interfaces import Connection
from rosbags.typesys import Stores, get_typestore
from tqdm import tqdm

from trigpoint.errors import EventRejected, InputError
from trigpoint.events.keys import valid_name
from trigpoint.events.observed import Observed, VehicleDescribed
from trigpoint_vehicle.cloud_conversion import CloudDrive, LeftAside
from trigpoint_vehicle.core.mountings import AT_BASE, Mounting
from trigpoint_vehicle.core.recording import Timed, boot_id_of, nearly_ordered
from trigpoint_vehicle.core.ros_messages import (
    FrameTransform,
    fix_event,
    imu_event,
    mounting_in,
    specific_force,
    stamp_of,
    sweep_event,
    transforms_of,
    up_in_imu,
    wheel_event,
)

Floats = NDArray[np.float64]

CLOUD, FIX = "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/NavSatFix"
IMU, ODOMETRY = "sensor_msgs/msg/Imu", "nav_msgs/msg/Odometry"
TRANSFORMS, STATIC_TOPIC = "tf2_msgs/msg/TFMessage", "/tf_static"
TAKEN = (CLOUD, FIX, IMU, ODOMETRY)
LATE_NS = 1_000_000_000  # a cloud is stamped at its beginning, and sent when it is whole
UNREADABLE = (AnyReaderError, ValueError, IndexError, KeyError, struct.error)  # what a damaged message makes of itself


@dataclass(frozen=True, slots=True, kw_only=True)
class BagChoice:
    """What of a bag is whose: the vehicle's name, the frame that is its base, the topics taken (none: all), and
    mountings of sensors by frame, which go before the bag's own /tf_static.
    """

    vehicle: str
    base: str = "base_link"
    topics: frozenset[str] = frozenset()
    mountings: Mapping[str, Mounting]


@contextmanager
def opened_bag(source: Path) -> Iterator[AnyReader]:
    """The bag: a .bag file, a ROS 2 bag's folder, or one .mcap of it. Raises InputError."""
    if not source.exists():
        raise InputError(f"{source}: no such file or folder; a ROS bag is needed")
    try:
        with AnyReader([source], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            yield reader
    except (AnyReaderError, OSError, struct.error) as error:
        raise InputError(f"{source}: no ROS bag that can be read: {error}") from error


def bag_drive(reader: AnyReader, source: Path, choice: BagChoice) -> CloudDrive:
    """The drive in an opened bag, to be read while that is open. Raises InputError where topics or mountings are not
    clear, or clouds come without a path.
    """
    by_type = _connections(reader, source, choice)
    transforms = {one.child: one for message in _static(reader) for one in transforms_of(message)}
    antenna = _antenna(reader, by_type[FIX], transforms, choice)
    events = _BagEvents(
        reader=reader,
        mountings=_mountings(reader, by_type[CLOUD], transforms, choice),
        up=_up(reader, by_type[IMU]),
        left_aside=LeftAside(),
    )
    described = VehicleDescribed(
        vehicle=valid_name(choice.vehicle),
        antenna_x_m=float(antenna.position_m[0]),
        antenna_y_m=float(antenna.position_m[1]),
        software="trigpoint convert rosbag",
    )
    state = f"{source.name} {reader.start_time} {reader.end_time} {reader.message_count}"
    taken = [connection for connections in by_type.values() for connection in connections]
    return CloudDrive(
        described=described,
        boot_id=boot_id_of(state.encode()),
        streams=(nearly_ordered(events.timed(taken), span_ns=LATE_NS),),
        left_aside=events.left_aside,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _BagEvents:
    """A bag's messages as events; what cannot be one is counted. `up` (3,) is the vertical in the IMU's axes."""

    reader: AnyReader
    mountings: Mapping[str, Mounting]
    up: Floats
    left_aside: LeftAside

    def timed(self, connections: Collection[Connection]) -> Iterator[Timed]:
        """The events of these connections, as they arrived."""
        total = sum(connection.msgcount for connection in connections)
        rows = self.reader.messages(connections=connections)
        for connection, arrived_ns, raw in tqdm(rows, desc="reading", total=total, unit="message", disable=None):
            try:
                message: Any = self.reader.deserialize(raw, connection.msgtype)
                stamp_ns = stamp_of(message, arrived_ns)
                event = self._event_of(connection.msgtype, message, stamp_ns)
            except EventRejected as error:
                self.left_aside.add(error.reason, f"{connection.topic} at {arrived_ns} ns: {error.detail}")
            except UNREADABLE as error:
                self.left_aside.add("unreadable message", f"{connection.topic} at {arrived_ns} ns: {error!r}")
            else:
                yield stamp_ns, event

    def _event_of(self, kind: str, message: Any, stamp_ns: int) -> Observed:
        if kind == IMU:
            return imu_event(message, self.up)
        if kind == ODOMETRY:
            return wheel_event(message)
        if kind == FIX:
            return fix_event(message)
        frame = message.header.frame_id
        if frame not in self.mountings:
            raise EventRejected("unknown frame", f"{frame!r}: the first clouds are in {', '.join(self.mountings)}")
        return sweep_event(message, self.mountings[frame], stamp_ns=stamp_ns)


def _connections(reader: AnyReader, source: Path, choice: BagChoice) -> dict[str, list[Connection]]:
    """The connections to be taken, by type of message."""
    there = {connection.topic for connection in reader.connections}
    missing = sorted(choice.topics - there)
    if missing:
        raise InputError(f"{source}: no topic {', '.join(missing)}; there are {', '.join(sorted(there))}")
    wanted = [one for one in reader.connections if not choice.topics or one.topic in choice.topics]
    by_type = {kind: [one for one in wanted if one.msgtype == kind] for kind in TAKEN}
    for kind in (FIX, IMU, ODOMETRY):
        topics = sorted({one.topic for one in by_type[kind]})
        if len(topics) > 1:
            raise InputError(
                f"{source}: {kind} on {', '.join(topics)}: choose one with --topic, and the others you want"
            )
    if not any(by_type.values()):
        raise InputError(f"{source}: none of {', '.join(TAKEN)} in it; its topics are {', '.join(sorted(there))}")
    if by_type[CLOUD] and not by_type[FIX] and not by_type[ODOMETRY]:
        raise InputError(f"{source}: clouds without a path: neither {FIX} nor {ODOMETRY} is there")
    return by_type


def _static(reader: AnyReader) -> list[Any]:
    said = [one for one in reader.connections if one.topic == STATIC_TOPIC and one.msgtype == TRANSFORMS]
    return list(_readable(reader, said)) if said else []


def _readable(reader: AnyReader, connections: Collection[Connection]) -> Iterator[Any]:
    """The messages that can be read; the others are counted when events are made of them."""
    for connection, _, raw in reader.messages(connections=connections):
        with contextlib.suppress(*UNREADABLE):
            yield reader.deserialize(raw, connection.msgtype)


def _frames(reader: AnyReader, connections: Collection[Connection]) -> list[str]:
    """The frame of each connection's first message that can be read."""
    firsts = [next(_readable(reader, [connection]), None) for connection in connections]
    return list(dict.fromkeys(str(first.header.frame_id) for first in firsts if first is not None))


def _mountings(
    reader: AnyReader, connections: Sequence[Connection], transforms: Mapping[str, FrameTransform], choice: BagChoice
) -> dict[str, Mounting]:
    found = dict(choice.mountings)
    for frame in _frames(reader, connections):
        mounting = found.get(frame) or mounting_in(choice.base, frame, transforms)
        if mounting is None:
            raise InputError(
                f"frame {frame!r} of the clouds: {STATIC_TOPIC} does not say where it is in {choice.base!r}; give "
                f"--lidar {frame}=X,Y,Z,ROLL,PITCH,YAW in m and degrees, or the base with --base"
            )
        found[frame] = mounting
    return found


def _antenna(
    reader: AnyReader, connections: Sequence[Connection], transforms: Mapping[str, FrameTransform], choice: BagChoice
) -> Mounting:
    """The antenna in the base frame; over the base where the bag does not say."""
    frames = _frames(reader, connections)
    return (mounting_in(choice.base, frames[0], transforms) if frames else None) or AT_BASE


def _up(reader: AnyReader, connections: Sequence[Connection]) -> Floats:
    """The vertical in the IMU's axes; the z axis where there is no IMU."""
    if not connections:
        return np.array([0.0, 0.0, 1.0])
    forces = [specific_force(message) for message in _readable(reader, connections)]
    return up_in_imu(np.array(forces).reshape(-1, 3))
