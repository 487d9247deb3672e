"""What a vehicle detected, told of as if perception had found it in points."""

import math
from typing import Any

from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import LandmarkDetection, VehicleDescribed
from trigpoint.events.perceived import LandmarksPerceived, PerceivedLandmark

VARIANCE_M2 = 0.1**2  # of a sight, per axis, as perception tells it


def by_perception(row: Envelope[Any], described: VehicleDescribed, sequence: int) -> Envelope[Any]:
    """Perception's word, numbered so, of what a vehicle detected in a sweep."""
    event = LandmarksPerceived(
        vehicle=row.identity.source,
        boot_id=row.identity.boot_id,
        sensor="roof",
        sweep_sequence=row.identity.sequence,
        refusal="",
        landmarks=tuple(in_base(seen, described) for seen in row.event.detections),
    )
    return Envelope(EventIdentity("perception", "boot-1", sequence), row.stamp_ns, event)


def in_base(seen: LandmarkDetection, described: VehicleDescribed) -> PerceivedLandmark:
    """A detection as perception tells of it, in the base frame."""
    angle_rad = seen.bearing_rad + described.landmark_sensor_yaw_rad
    return PerceivedLandmark(
        kind=seen.kind,
        landmark_class=seen.kind,
        track=0,
        x_m=described.landmark_sensor_x_m + seen.range_m * math.cos(angle_rad),
        y_m=described.landmark_sensor_y_m + seen.range_m * math.sin(angle_rad),
        variance_x_m2=VARIANCE_M2,
        covariance_xy_m2=0.0,
        variance_y_m2=VARIANCE_M2,
        height_m=4.0,
        diameter_m=seen.diameter_m,
        points=20,
    )
