"""How each class of events is written as a Protobuf message, and read from one."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from operator import attrgetter
from typing import Any, Generic, TypeVar

import numpy as np
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from google.protobuf.message import Message
from numpy.typing import NDArray

from trigpoint.errors import EventRejected
from trigpoint.events.cloud_forms import cloud_event, cloud_message
from trigpoint.events.corrected import AnchorLabelled, AnchorRetracted, DriveExcluded, DriveIncluded
from trigpoint.events.estimated import FixJudged, GateAlarmed, PoseFiltered
from trigpoint.events.mapped import (
    AnchorAssociated,
    ImageOffsetSolved,
    LabelGainSolved,
    LandmarkSolved,
    MapSolved,
    OdometryCorrected,
    TrajectorySolved,
)
from trigpoint.events.observed import (
    EventRefused,
    GnssFixReceived,
    ImuMeasured,
    LandmarkDetection,
    LandmarksDetected,
    MapFramePinned,
    VehicleDescribed,
    WheelPairMeasured,
    WheelSpeedMeasured,
)
from trigpoint.events.perceived import LandmarksPerceived, LoopClosed, LoopsSought, OdometryMatched
from trigpoint.events.perceived_forms import perceived_event, perceived_message, sought_event, sought_message
from trigpoint.events.scanned import PointsScanned
from trigpoint_schemas.v1 import corrected_pb2, estimated_pb2, mapped_pb2, observed_pb2, perceived_pb2

EventT = TypeVar("EventT")
MessageT = TypeVar("MessageT", bound=Message)
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Form(Generic[EventT, MessageT]):
    """How one class of events is written: the message class and both directions."""

    event_class: type[EventT]
    message_class: type[MessageT]
    message_of: Callable[[EventT], MessageT]
    event_of: Callable[[MessageT], EventT]


def _flat(event_class: type[EventT], message_class: type[MessageT]) -> Form[EventT, MessageT]:
    """The form of an event whose fields are all scalars that the message has under the same names."""
    names = [field.name for field in fields(event_class)]  # type: ignore[arg-type]  # all are dataclasses
    values_of = attrgetter(*names)

    def message_of(event: EventT) -> MessageT:
        return message_class(**dict(zip(names, values_of(event), strict=True)))

    def event_of(message: MessageT) -> EventT:
        return event_class(**dict(zip(names, values_of(message), strict=True)))

    return Form(event_class, message_class, message_of, event_of)


# The two most frequent events by far are written out, which spares them the detour through names.
def _wheel_event(message: observed_pb2.WheelSpeedMeasured) -> WheelSpeedMeasured:
    return WheelSpeedMeasured(
        speed_mps=message.speed_mps, steering_rad=message.steering_rad, yaw_rate_radps=message.yaw_rate_radps
    )


def _imu_event(message: observed_pb2.ImuMeasured) -> ImuMeasured:
    return ImuMeasured(
        yaw_rate_radps=message.yaw_rate_radps,
        acceleration_x_mps2=message.acceleration_x_mps2,
        acceleration_y_mps2=message.acceleration_y_mps2,
    )


def _listed(array: Floats, shape: tuple[int, ...]) -> list[float]:
    """The array's numbers row by row. Raises EventRejected for another shape."""
    if array.shape != shape:
        raise EventRejected("unencodable", f"array of shape {array.shape}, expected {shape}")
    values: list[float] = np.asarray(array, dtype=np.float64).ravel().tolist()
    return values


def _array(values: Sequence[float], shape: tuple[int, ...]) -> Floats:
    """The numbers as an array. Raises EventRejected if there are not as many as the shape asks for."""
    array = np.array(values[:], dtype=np.float64)  # of a list: six times faster than of Protobuf's
    if array.size != math.prod(shape):
        raise EventRejected("undecodable", f"{len(values)} numbers, expected {math.prod(shape)} of shape {shape}")
    return array if len(shape) == 1 else array.reshape(shape)


def _with_covariance(event_class: type[EventT], message_class: type[MessageT]) -> Form[EventT, MessageT]:
    """The form of an event whose fields are scalars, but for a covariance (3, 3)."""
    names = [field.name for field in fields(event_class) if field.name != "covariance"]  # type: ignore[arg-type]
    values_of, covariance_of = attrgetter(*names), attrgetter("covariance")

    def message_of(event: EventT) -> MessageT:
        values = dict(zip(names, values_of(event), strict=True))
        return message_class(**values | {"covariance": _listed(covariance_of(event), (3, 3))})

    def event_of(message: MessageT) -> EventT:
        values = dict(zip(names, values_of(message), strict=True))
        return event_class(**values | {"covariance": _array(covariance_of(message), (3, 3))})

    return Form(event_class, message_class, message_of, event_of)


def _fix_message(event: GnssFixReceived) -> LocationFix:
    """The variance's sign is sigma's, so that even a nonsensical sigma comes back as it was sent."""
    message = LocationFix(latitude=event.lat_deg, longitude=event.lon_deg, altitude=event.height_m)
    if not math.isnan(event.sigma_m):
        variance_m2 = math.copysign(event.sigma_m * event.sigma_m, event.sigma_m)
        message.position_covariance.extend((variance_m2, 0.0, 0.0, 0.0, variance_m2, 0.0, 0.0, 0.0, variance_m2))
        message.position_covariance_type = LocationFix.DIAGONAL_KNOWN
    return message


def _fix_event(message: LocationFix) -> GnssFixReceived:
    """Sigma is that of the worse horizontal axis; the square root of a square is exact from 1e-150 to 1e150."""
    sigma_m = math.nan
    if message.position_covariance_type != LocationFix.UNKNOWN:
        covariance = message.position_covariance
        if len(covariance) != 9:
            raise EventRejected("undecodable", f"position covariance has {len(covariance)} numbers, expected 9")
        variance_m2 = max(covariance[0], covariance[4])
        sigma_m = math.copysign(math.sqrt(abs(variance_m2)), variance_m2)
    return GnssFixReceived(
        lat_deg=message.latitude, lon_deg=message.longitude, height_m=message.altitude, sigma_m=sigma_m
    )


def _sweep_message(event: LandmarksDetected) -> observed_pb2.LandmarksDetected:
    message = observed_pb2.LandmarksDetected()
    add = message.detections.add
    for seen in event.detections:
        add(
            range_m=seen.range_m,
            bearing_rad=seen.bearing_rad,
            kind=seen.kind,
            signature=seen.signature,
            diameter_m=seen.diameter_m,
        )
    return message


def _sweep_event(message: observed_pb2.LandmarksDetected) -> LandmarksDetected:
    return LandmarksDetected(
        detections=tuple(
            LandmarkDetection(seen.range_m, seen.bearing_rad, seen.kind, seen.signature, seen.diameter_m)
            for seen in message.detections
        )
    )


def _map_message(event: MapSolved) -> mapped_pb2.MapSolved:
    return mapped_pb2.MapSolved(
        map_version=event.map_version,
        method=event.method,
        settings_json=event.settings_json,
        inputs=[mapped_pb2.StreamCount(stream=stream, count=count) for stream, count in event.inputs],
        landmark_count=event.landmark_count,
        anchor_count=event.anchor_count,
        wall_s=event.wall_s,
        base_version=event.base_version,
        removed=event.removed,
    )


def _map_event(message: mapped_pb2.MapSolved) -> MapSolved:
    return MapSolved(
        map_version=message.map_version,
        method=message.method,
        settings_json=message.settings_json,
        inputs=tuple((row.stream, row.count) for row in message.inputs),
        landmark_count=message.landmark_count,
        anchor_count=message.anchor_count,
        wall_s=message.wall_s,
        base_version=message.base_version,
        removed=tuple(message.removed),
    )


def _trajectory_message(event: TrajectorySolved) -> mapped_pb2.TrajectorySolved:
    count = len(event.stamp_ns)
    return mapped_pb2.TrajectorySolved(
        map_version=event.map_version,
        vehicle=event.vehicle,
        boot_id=event.boot_id,
        stamp_ns=event.stamp_ns.tolist(),
        pose=_listed(event.pose, (count, 3)),
        covariance=_listed(event.covariance, (count, 3, 3)),
        calibration=[
            mapped_pb2.CalibrationState(name=name, value=value, sigma=sigma) for name, value, sigma in event.calibration
        ],
    )


def _trajectory_event(message: mapped_pb2.TrajectorySolved) -> TrajectorySolved:
    count = len(message.stamp_ns)
    return TrajectorySolved(
        map_version=message.map_version,
        vehicle=message.vehicle,
        boot_id=message.boot_id,
        stamp_ns=np.array(message.stamp_ns, dtype=np.int64),
        pose=_array(message.pose, (count, 3)),
        covariance=_array(message.covariance, (count, 3, 3)),
        calibration=tuple((state.name, state.value, state.sigma) for state in message.calibration),
    )


def _landmark_message(event: LandmarkSolved) -> mapped_pb2.LandmarkSolved:
    message = mapped_pb2.LandmarkSolved(
        map_version=event.map_version,
        landmark=event.landmark,
        kind=event.kind,
        signature=event.signature,
        position_m=_listed(event.position_m, (2,)),
        covariance_m2=_listed(event.covariance_m2, (2, 2)),
        observation_count=event.observation_count,
        vehicles=event.vehicles,
        first_seen_ns=event.first_seen_ns,
        last_seen_ns=event.last_seen_ns,
        anchors=event.anchors,
    )
    for vehicle, boot_id, sequence in event.observations:
        message.observations.add(vehicle=vehicle, boot_id=boot_id, sequence=sequence)
    return message


def _landmark_event(message: mapped_pb2.LandmarkSolved) -> LandmarkSolved:
    return LandmarkSolved(
        map_version=message.map_version,
        landmark=message.landmark,
        kind=message.kind,
        signature=message.signature,
        position_m=_array(message.position_m, (2,)),
        covariance_m2=_array(message.covariance_m2, (2, 2)),
        observation_count=message.observation_count,
        vehicles=tuple(message.vehicles[:]),
        first_seen_ns=message.first_seen_ns,
        last_seen_ns=message.last_seen_ns,
        anchors=tuple(message.anchors[:]),
        observations=tuple([(sweep.vehicle, sweep.boot_id, sweep.sequence) for sweep in message.observations]),
    )


def _association_message(event: AnchorAssociated) -> mapped_pb2.AnchorAssociated:
    return mapped_pb2.AnchorAssociated(
        map_version=event.map_version,
        anchor=event.anchor,
        landmark=event.landmark,
        reason=event.reason,
        residual_m=_listed(event.residual_m, (2,)),
        image=event.image,
    )


def _association_event(message: mapped_pb2.AnchorAssociated) -> AnchorAssociated:
    return AnchorAssociated(
        map_version=message.map_version,
        anchor=message.anchor,
        landmark=message.landmark,
        reason=message.reason,
        residual_m=_array(message.residual_m, (2,)),
        image=message.image,
    )


def _offset_message(event: ImageOffsetSolved) -> mapped_pb2.ImageOffsetSolved:
    return mapped_pb2.ImageOffsetSolved(
        map_version=event.map_version,
        image=event.image,
        offset_m=_listed(event.offset_m, (2,)),
        covariance_m2=_listed(event.covariance_m2, (2, 2)),
    )


def _offset_event(message: mapped_pb2.ImageOffsetSolved) -> ImageOffsetSolved:
    return ImageOffsetSolved(
        map_version=message.map_version,
        image=message.image,
        offset_m=_array(message.offset_m, (2,)),
        covariance_m2=_array(message.covariance_m2, (2, 2)),
    )


def _gain_message(event: LabelGainSolved) -> mapped_pb2.LabelGainSolved:
    shape = (len(event.landmarks), 3)
    return mapped_pb2.LabelGainSolved(
        map_version=event.map_version,
        image=event.image,
        landmarks=event.landmarks,
        expected_m2=_listed(event.expected_m2, shape),
        shared_m4=_listed(event.shared_m4, shape),
    )


def _gain_event(message: mapped_pb2.LabelGainSolved) -> LabelGainSolved:
    shape = (len(message.landmarks), 3)
    return LabelGainSolved(
        map_version=message.map_version,
        image=message.image,
        landmarks=tuple(message.landmarks[:]),
        expected_m2=_array(message.expected_m2, shape),
        shared_m4=_array(message.shared_m4, shape),
    )


def _odometry_message(event: OdometryCorrected) -> mapped_pb2.OdometryCorrected:
    return mapped_pb2.OdometryCorrected(
        vehicle=event.vehicle,
        boot_id=event.boot_id,
        map_version=event.map_version,
        T_map_odom=_listed(event.T_map_odom, (3,)),
        covariance=_listed(event.covariance, (3, 3)),
    )


def _odometry_event(message: mapped_pb2.OdometryCorrected) -> OdometryCorrected:
    return OdometryCorrected(
        vehicle=message.vehicle,
        boot_id=message.boot_id,
        map_version=message.map_version,
        T_map_odom=_array(message.T_map_odom, (3,)),
        covariance=_array(message.covariance, (3, 3)),
    )


FORMS: tuple[Form[Any, Any], ...] = (
    _flat(VehicleDescribed, observed_pb2.VehicleDescribed),
    replace(_flat(WheelSpeedMeasured, observed_pb2.WheelSpeedMeasured), event_of=_wheel_event),
    _flat(WheelPairMeasured, observed_pb2.WheelPairMeasured),
    replace(_flat(ImuMeasured, observed_pb2.ImuMeasured), event_of=_imu_event),
    Form(GnssFixReceived, LocationFix, _fix_message, _fix_event),
    Form(LandmarksDetected, observed_pb2.LandmarksDetected, _sweep_message, _sweep_event),
    Form(PointsScanned, PointCloud, cloud_message, cloud_event),
    _flat(EventRefused, observed_pb2.EventRefused),
    _flat(MapFramePinned, observed_pb2.MapFramePinned),
    _flat(AnchorLabelled, corrected_pb2.AnchorLabelled),
    _flat(AnchorRetracted, corrected_pb2.AnchorRetracted),
    _flat(DriveExcluded, corrected_pb2.DriveExcluded),
    _flat(DriveIncluded, corrected_pb2.DriveIncluded),
    _flat(FixJudged, estimated_pb2.FixJudged),
    _with_covariance(PoseFiltered, estimated_pb2.PoseFiltered),
    _flat(GateAlarmed, estimated_pb2.GateAlarmed),
    Form(LandmarksPerceived, perceived_pb2.LandmarksPerceived, perceived_message, perceived_event),
    _with_covariance(OdometryMatched, perceived_pb2.OdometryMatched),
    _with_covariance(LoopClosed, perceived_pb2.LoopClosed),
    Form(LoopsSought, perceived_pb2.LoopsSought, sought_message, sought_event),
    Form(MapSolved, mapped_pb2.MapSolved, _map_message, _map_event),
    Form(TrajectorySolved, mapped_pb2.TrajectorySolved, _trajectory_message, _trajectory_event),
    Form(LandmarkSolved, mapped_pb2.LandmarkSolved, _landmark_message, _landmark_event),
    Form(AnchorAssociated, mapped_pb2.AnchorAssociated, _association_message, _association_event),
    Form(ImageOffsetSolved, mapped_pb2.ImageOffsetSolved, _offset_message, _offset_event),
    Form(LabelGainSolved, mapped_pb2.LabelGainSolved, _gain_message, _gain_event),
    Form(OdometryCorrected, mapped_pb2.OdometryCorrected, _odometry_message, _odometry_event),
)
