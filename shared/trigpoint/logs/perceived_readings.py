"""What perception found, as detections of the drives it was found in: observations for a solve."""

import math
from collections.abc import Mapping
from typing import cast

from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.observed import LandmarkDetection, LandmarksDetected, VehicleDescribed
from trigpoint.events.perceived import LandmarksPerceived, PerceivedLandmark
from trigpoint.geodesy.poses import Pose2
from trigpoint.logs.ports import EventLog

PERCEIVED_STREAM = STREAM_PATTERNS[LandmarksPerceived]

DriveName = tuple[str, str]


def perceived_sweeps(
    log: EventLog, described: Mapping[DriveName, VehicleDescribed]
) -> tuple[Envelope[LandmarksDetected], ...]:
    """The perceived landmarks of the named drives (vehicle, boot), as sweeps of their landmark sensor.

    Each is named by its sweep's own identity. Where a drive was perceived more than once, by other settings, the last
    time counts.
    """
    sweeps: dict[DriveName, list[Envelope[LandmarksDetected]]] = {}
    told_as: dict[DriveName, str] = {}
    for row in log.read(PERCEIVED_STREAM, kinds=(LandmarksPerceived,)):
        event, told = cast(LandmarksPerceived, row.envelope.event), row.envelope.identity.boot_id
        name = (event.vehicle, event.boot_id)
        if name not in described:
            continue
        if told_as.get(name) != told:
            told_as[name], sweeps[name] = told, []
        sweeps[name].append(_sweep(event, row.envelope.stamp_ns, described[name]))
    return tuple(sweep for each in sweeps.values() for sweep in each)


def _sweep(event: LandmarksPerceived, stamp_ns: int, described: VehicleDescribed) -> Envelope[LandmarksDetected]:
    identity = EventIdentity(event.vehicle, event.boot_id, event.sweep_sequence)
    return Envelope(identity, stamp_ns, detected_in(event, described))


def detected_in(event: LandmarksPerceived, described: VehicleDescribed) -> LandmarksDetected:
    """A sweep's landmarks by range and bearing from the vehicle's landmark sensor, without a signature."""
    T_sensor_base = Pose2(
        described.landmark_sensor_x_m, described.landmark_sensor_y_m, described.landmark_sensor_yaw_rad
    ).inverse()
    return LandmarksDetected(detections=tuple(_detection(landmark, T_sensor_base) for landmark in event.landmarks))


def _detection(landmark: PerceivedLandmark, T_sensor_base: Pose2) -> LandmarkDetection:
    x_m, y_m = T_sensor_base.transform(landmark.x_m, landmark.y_m)
    return LandmarkDetection(math.hypot(x_m, y_m), math.atan2(y_m, x_m), landmark.kind, "", landmark.diameter_m)
