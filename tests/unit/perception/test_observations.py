"""What was perceived becomes detections of its drive."""

import math

import pytest

from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import VehicleDescribed
from trigpoint.events.perceived import LandmarksPerceived, PerceivedLandmark
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.perceived_readings import PERCEIVED_STREAM
from trigpoint.logs.readings import logged_drives

POLE = PerceivedLandmark(
    kind="pole",
    landmark_class="trunk",
    track=0,
    x_m=5.0,
    y_m=3.0,
    variance_x_m2=0.01,
    covariance_xy_m2=0.0,
    variance_y_m2=0.01,
    height_m=4.0,
    diameter_m=0.3,
    points=40,
)


def perceived(told_as: str, sequence: int, *, boot_id: str = "boot-1") -> Envelope[Event]:
    event = LandmarksPerceived(
        vehicle="van", boot_id=boot_id, sensor="roof", sweep_sequence=sequence, refusal="", landmarks=(POLE,)
    )
    return Envelope(EventIdentity("perception", told_as, sequence), 1_000 + sequence, event)


@pytest.fixture
def log() -> MemoryLog:
    filled = MemoryLog()
    described = VehicleDescribed(
        vehicle="van", landmark_sensor_x_m=1.0, landmark_sensor_y_m=0.0, landmark_sensor_yaw_rad=math.pi / 2
    )
    filled.append("veh-van", [Envelope(EventIdentity("van", "boot-1", 0), 1_000, described)])
    return filled


def test_a_landmark_is_told_in_the_landmark_sensors_frame(log: MemoryLog) -> None:
    log.append(PERCEIVED_STREAM, [perceived("one", 7)])
    (drive,) = logged_drives(log)
    assert drive.detections.range_m.tolist() == [pytest.approx(5.0)]
    assert drive.detections.bearing_rad.tolist() == [pytest.approx(math.atan2(-4.0, 3.0))]
    assert (drive.detections.kind, drive.detections.sequence.tolist()) == (("pole",), [7])


def test_of_a_drive_perceived_twice_the_last_time_counts(log: MemoryLog) -> None:
    log.append(PERCEIVED_STREAM, [perceived("one", 7), perceived("one", 8), perceived("two", 9)])
    (drive,) = logged_drives(log)
    assert drive.detections.sequence.tolist() == [9]


def test_what_was_perceived_of_no_logged_drive_is_passed_over(log: MemoryLog) -> None:
    log.append(PERCEIVED_STREAM, [perceived("one", 7, boot_id="boot-2")])
    (drive,) = logged_drives(log)
    assert len(drive.detections.sequence) == 0
