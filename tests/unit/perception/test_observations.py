"""What was perceived becomes detections of its drive."""

import math
from dataclasses import replace

import numpy as np
import pytest

from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import LandmarkDetection, LandmarksDetected, VehicleDescribed
from trigpoint.events.perceived import LandmarksPerceived, OdometryMatched, PerceivedLandmark
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
    covariance_xy_m2=0.002,
    variance_y_m2=0.03,
    height_m=4.0,
    diameter_m=0.3,
    points=40,
)


def perceived(
    told_as: str, sequence: int, *, boot_id: str = "boot-1", found: tuple[PerceivedLandmark, ...] = (POLE,)
) -> Envelope[Event]:
    event = LandmarksPerceived(
        vehicle="van", boot_id=boot_id, sensor="roof", sweep_sequence=sequence, refusal="", landmarks=found
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


def detected(sequence: int, *signatures: str, stamp_ns: int = 1_000) -> Envelope[Event]:
    """What the vehicle itself says it saw."""
    seen = tuple(LandmarkDetection(9.0, 0.1, "pole", signature, 0.2) for signature in signatures)
    return Envelope(EventIdentity("van", "boot-1", sequence), stamp_ns, LandmarksDetected(detections=seen))


def matched(told_as: str, sequence: int, *, sensor: str = "roof") -> Envelope[Event]:
    event = OdometryMatched(
        vehicle="van",
        boot_id="boot-1",
        sensor=sensor,
        from_sequence=sequence - 1,
        from_stamp_ns=1_000 + sequence - 1,
        sweep_sequence=sequence,
        x_m=0.5,
        y_m=0.1 * sequence,
        heading_rad=0.01,
        covariance=np.diag([0.01, 0.02, 0.0001]),
        matched_share=0.9,
    )
    return Envelope(EventIdentity("perception", told_as, 100 + sequence), 1_000 + sequence, event)


def test_a_perceived_landmark_keeps_its_covariance_in_the_base_frame(log: MemoryLog) -> None:
    log.append(PERCEIVED_STREAM, [perceived("one", 7)])
    (drive,) = logged_drives(log)
    assert drive.detections.covariance_m2 is not None
    assert drive.detections.covariance_m2.tolist() == [[[0.01, 0.002], [0.002, 0.03]]]


def test_what_the_vehicle_detected_stands_back_where_something_was_perceived(log: MemoryLog) -> None:
    log.append("veh-van", [detected(1, "", stamp_ns=1_008)])
    log.append(PERCEIVED_STREAM, [perceived("one", 7), perceived("one", 9)])
    (drive,) = logged_drives(log)
    assert drive.detections.sequence.tolist() == [7, 9]


def test_what_the_vehicle_detected_counts_as_long_as_its_sweeps_are_not_perceived(log: MemoryLog) -> None:
    log.append("veh-van", [detected(1, "", stamp_ns=1_006), detected(2, "", stamp_ns=1_008)])
    log.append(PERCEIVED_STREAM, [perceived("one", 7)])
    (drive,) = logged_drives(log)
    assert drive.detections.sequence.tolist() == [1, 7, 2]


def test_a_drive_in_which_nothing_was_perceived_keeps_what_it_detected(log: MemoryLog) -> None:
    log.append("veh-van", [detected(1, "")])
    log.append(PERCEIVED_STREAM, [perceived("one", 7, found=())])
    (drive,) = logged_drives(log)
    assert (drive.detections.sequence.tolist(), drive.detections.covariance_m2) == ([1], None)


def test_what_says_what_it_is_stays_beside_what_was_perceived(log: MemoryLog) -> None:
    log.append("veh-van", [detected(1, "", "car-2", stamp_ns=1_008)])
    log.append(PERCEIVED_STREAM, [perceived("one", 7), perceived("one", 9)])
    (drive,) = logged_drives(log)
    assert drive.detections.sequence.tolist() == [7, 1, 9]  # in order of time
    assert drive.detections.signature == ("", "car-2", "")
    assert drive.detections.covariance_m2 is not None
    assert np.isfinite(drive.detections.covariance_m2[:, 0, 0]).tolist() == [True, False, True]


def test_beside_a_camera_nothing_that_was_perceived_counts(log: MemoryLog) -> None:
    camera = VehicleDescribed(vehicle="van", landmark_sensor_model="camera")
    log.append("veh-van", [Envelope(EventIdentity("van", "boot-1", 1), 1_001, camera), detected(2, "")])
    log.append(PERCEIVED_STREAM, [perceived("one", 7)])
    (drive,) = logged_drives(log)
    assert drive.detections.sequence.tolist() == [2]


def test_motions_by_matched_points_belong_to_their_drive(log: MemoryLog) -> None:
    log.append(PERCEIVED_STREAM, [matched("one", 6), matched("two", 9), matched("two", 8)])
    (drive,) = logged_drives(log)
    assert (drive.matched.from_stamp_ns.tolist(), drive.matched.stamp_ns.tolist()) == ([1_007, 1_008], [1_008, 1_009])
    assert drive.matched.motion.tolist() == [[0.5, 0.8, 0.01], [0.5, 0.9, 0.01]]
    assert drive.matched.covariance[0].tolist() == np.diag([0.01, 0.02, 0.0001]).tolist()


def test_motions_of_two_sensors_do_not_break_one_anothers_chain(log: MemoryLog) -> None:
    rows = [matched("one", 6), matched("one", 6, sensor="front"), matched("one", 7), matched("one", 7, sensor="front")]
    numbered = [replace(row, identity=replace(row.identity, sequence=n)) for n, row in enumerate(rows)]
    log.append(PERCEIVED_STREAM, numbered)
    (drive,) = logged_drives(log)
    assert drive.matched.from_stamp_ns.tolist() == [1_005, 1_006, 1_005, 1_006]
