"""How the landmarks of a sweep are written as a Protobuf message, and read from one."""

from dataclasses import fields
from operator import attrgetter

from trigpoint.events.perceived import LandmarksPerceived, LoopsSought, PerceivedLandmark, RefusedLoops, SoughtDrive
from trigpoint_schemas.v1 import perceived_pb2

NAMES = tuple(field.name for field in fields(PerceivedLandmark))
_values_of = attrgetter(*NAMES)


def perceived_message(event: LandmarksPerceived) -> perceived_pb2.LandmarksPerceived:
    """The message of a sweep's landmarks."""
    message = perceived_pb2.LandmarksPerceived(
        vehicle=event.vehicle,
        boot_id=event.boot_id,
        sensor=event.sensor,
        sweep_sequence=event.sweep_sequence,
        refusal=event.refusal,
    )
    for landmark in event.landmarks:
        message.landmarks.add(**dict(zip(NAMES, _values_of(landmark), strict=True)))
    return message


def perceived_event(message: perceived_pb2.LandmarksPerceived) -> LandmarksPerceived:
    """The landmarks a message holds."""
    return LandmarksPerceived(
        vehicle=message.vehicle,
        boot_id=message.boot_id,
        sensor=message.sensor,
        sweep_sequence=message.sweep_sequence,
        refusal=message.refusal,
        landmarks=tuple(
            PerceivedLandmark(**dict(zip(NAMES, _values_of(each), strict=True))) for each in message.landmarks
        ),
    )


def sought_message(event: LoopsSought) -> perceived_pb2.LoopsSought:
    """The message of a search for loops."""
    return perceived_pb2.LoopsSought(
        vehicle=event.vehicle,
        boot_id=event.boot_id,
        among=[perceived_pb2.SoughtDrive(vehicle=each.vehicle, boot_id=each.boot_id) for each in event.among],
        proposed=event.proposed,
        verified=event.verified,
        refused=[perceived_pb2.RefusedLoops(reason=each.reason, count=each.count) for each in event.refused],
    )


def sought_event(message: perceived_pb2.LoopsSought) -> LoopsSought:
    """The search a message tells of."""
    return LoopsSought(
        vehicle=message.vehicle,
        boot_id=message.boot_id,
        among=tuple(SoughtDrive(vehicle=each.vehicle, boot_id=each.boot_id) for each in message.among),
        proposed=message.proposed,
        verified=message.verified,
        refused=tuple(RefusedLoops(reason=each.reason, count=each.count) for each in message.refused),
    )
