"""Perception on a log: each sweep told of once, whatever is run again; excluded drives are left out."""

import numpy as np
import pytest

from scanned_worlds.casting import PERIOD_NS, SIXTEEN, START_NS, STREET, driven_pose, swept
from trigpoint.events.codec import Event
from trigpoint.events.corrected import DriveExcluded
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import VehicleDescribed, WheelSpeedMeasured
from trigpoint.events.perceived import LandmarksPerceived
from trigpoint.logs.memory_log import MemoryLog
from trigpoint_perception.app import STREAM, perceive_log
from trigpoint_perception.settings import PerceptionSettings, TrackSettings

VELOCITY = (6.0, 0.2)
COUNT = 6


def row(sequence: int, stamp_ns: int, event: Event, *, boot_id: str = "boot-1") -> Envelope[Event]:
    return Envelope(EventIdentity("van", boot_id, sequence), stamp_ns, event)


def drive_rows(boot_id: str = "boot-1") -> list[Envelope[Event]]:
    """A described vehicle with wheels, and sweeps."""
    rows = [row(0, START_NS, VehicleDescribed(vehicle="van", wheelbase_m=2.7), boot_id=boot_id)]
    speed = WheelSpeedMeasured(speed_mps=VELOCITY[0], steering_rad=float("nan"), yaw_rate_radps=VELOCITY[1])
    for number in range(COUNT):
        stamp_ns = START_NS + number * PERIOD_NS
        scanned = swept(STREET, SIXTEEN, pose=driven_pose(VELOCITY, 0.1 * number), velocity=VELOCITY)
        rows.append(row(2 * number + 1, stamp_ns, speed, boot_id=boot_id))
        rows.append(row(2 * number + 2, stamp_ns, scanned, boot_id=boot_id))
    return rows


@pytest.fixture
def log() -> MemoryLog:
    filled = MemoryLog()
    filled.append("veh-van", drive_rows())
    return filled


def sweeps_told(log: MemoryLog) -> list[int]:
    events = [logged.envelope.event for logged in log.read(STREAM)]
    return [event.sweep_sequence for event in events if isinstance(event, LandmarksPerceived)]


def test_every_sweep_of_a_drive_is_told_of(log: MemoryLog) -> None:
    (report,) = perceive_log(log)
    assert sweeps_told(log) == [2, 4, 6, 8, 10, 12]
    assert (report.sweeps, report.matched, report.poles, report.corners) == (6, 5, 5, 2)
    assert report.appended == 11


def test_again_nothing_is_appended_and_the_report_is_the_same_but_for_that(log: MemoryLog) -> None:
    (first,) = perceive_log(log)
    (second,) = perceive_log(log)
    assert (second.appended, log.next_number(STREAM)) == (0, 11)
    assert (second.sights, second.poles, second.matched) == (first.sights, first.poles, first.matched)


def test_what_was_cut_short_goes_on_where_it_stopped(log: MemoryLog) -> None:
    whole = MemoryLog()
    whole.append("veh-van", drive_rows())
    perceive_log(whole)
    rows = [logged.envelope for logged in whole.read(STREAM)]
    log.append(STREAM, rows[:4])
    (report,) = perceive_log(log)
    assert report.appended == 7
    assert [repr(logged.envelope) for logged in log.read(STREAM)] == [repr(row) for row in rows]


def test_an_excluded_drive_is_left_out(log: MemoryLog) -> None:
    log.append("veh-van", drive_rows("boot-2"))
    excluded = DriveExcluded(vehicle="van", boot_id="boot-1", author="me", reason="antenna loose")
    log.append("corrections", [Envelope(EventIdentity("cli", "c", 0), START_NS, excluded)])
    assert [report.boot_id for report in perceive_log(log)] == ["boot-2"]


def test_other_settings_tell_of_the_sweeps_anew(log: MemoryLog) -> None:
    perceive_log(log)
    (report,) = perceive_log(log, PerceptionSettings(track=TrackSettings(seen_min=2)))
    assert report.appended == 11


def test_progress_ends_at_the_number_of_sweeps(log: MemoryLog) -> None:
    heard: list[tuple[int, int]] = []
    perceive_log(log, progress=lambda done, total: heard.append((done, total)))
    assert heard[-1] == (6, 6)
    assert np.all(np.diff([done for done, _ in heard]) >= 0)


def test_a_log_without_sweeps_has_nothing_to_report() -> None:
    assert perceive_log(MemoryLog()) == ()
