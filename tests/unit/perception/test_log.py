"""Perception on a log: each sweep told of once, whatever is run again; excluded drives are left out."""

import numpy as np
import pytest

from scanned_worlds.casting import START_NS
from scanned_worlds.drives import scanned_drive
from trigpoint.errors import ServiceError
from trigpoint.events.codec import Event
from trigpoint.events.corrected import DriveExcluded
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.perceived import LandmarksPerceived
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import Progress, in_silence
from trigpoint.workers import workers
from trigpoint_perception.app import STREAM, DriveReport, perceive_log
from trigpoint_perception.settings import PerceptionSettings, TrackSettings

COUNT = 6


def drive_rows(boot_id: str = "boot-1") -> list[Envelope[Event]]:
    return list(scanned_drive("van", COUNT, boot_id=boot_id))


def perceived(
    log: EventLog, settings: PerceptionSettings | None = None, *, progress: Progress = in_silence
) -> tuple[DriveReport, ...]:
    with workers(threads=2) as some:
        return perceive_log(log, lambda: log, settings, some=some, progress=progress)


@pytest.fixture
def log() -> MemoryLog:
    filled = MemoryLog()
    filled.append("veh-van", drive_rows())
    return filled


def sweeps_told(log: MemoryLog) -> list[int]:
    events = [logged.envelope.event for logged in log.read(STREAM)]
    return [event.sweep_sequence for event in events if isinstance(event, LandmarksPerceived)]


def test_every_sweep_of_a_drive_is_told_of(log: MemoryLog) -> None:
    (report,) = perceived(log)
    assert sweeps_told(log) == [2, 4, 6, 8, 10, 12]
    assert (report.sweeps, report.matched, report.poles, report.corners) == (6, 5, 5, 2)
    assert report.appended == 11


def test_again_nothing_is_appended_and_the_report_is_the_same_but_for_that(log: MemoryLog) -> None:
    (first,) = perceived(log)
    (second,) = perceived(log)
    assert (second.appended, log.next_number(STREAM)) == (0, 11)
    assert (second.sights, second.poles, second.matched) == (first.sights, first.poles, first.matched)


def test_what_was_cut_short_goes_on_where_it_stopped(log: MemoryLog) -> None:
    whole = MemoryLog()
    whole.append("veh-van", drive_rows())
    perceived(whole)
    rows = [logged.envelope for logged in whole.read(STREAM)]
    log.append(STREAM, rows[:4])
    (report,) = perceived(log)
    assert report.appended == 7
    assert [repr(logged.envelope) for logged in log.read(STREAM)] == [repr(row) for row in rows]


def test_an_excluded_drive_is_left_out(log: MemoryLog) -> None:
    log.append("veh-van", drive_rows("boot-2"))
    excluded = DriveExcluded(vehicle="van", boot_id="boot-1", author="me", reason="antenna loose")
    log.append("corrections", [Envelope(EventIdentity("cli", "c", 0), START_NS, excluded)])
    assert [report.boot_id for report in perceived(log)] == ["boot-2"]


def test_other_settings_tell_of_the_sweeps_anew(log: MemoryLog) -> None:
    perceived(log)
    (report,) = perceived(log, PerceptionSettings(track=TrackSettings(seen_min=2)))
    assert report.appended == 11


def test_progress_ends_at_the_number_of_sweeps(log: MemoryLog) -> None:
    heard: list[tuple[int, int]] = []
    perceived(log, progress=lambda done, total: heard.append((done, total)))
    assert heard[-1] == (6, 6)
    assert np.all(np.diff([done for done, _ in heard]) >= 0)


def test_a_drive_that_cannot_be_read_costs_no_other(log: MemoryLog) -> None:
    log.append("veh-van", drive_rows("boot-2"))
    opened = iter([log])

    def once() -> MemoryLog:
        try:
            return next(opened)
        except StopIteration as error:
            raise OSError("too many open files") from error

    with workers(threads=1) as some, pytest.raises(ServiceError, match="1 of 2 drives not perceived: drive boot-"):
        perceive_log(log, once, some=some)
    assert len(sweeps_told(log)) == COUNT
    assert {report.appended for report in perceived(log)} == {0, 11}


def test_a_log_without_sweeps_has_nothing_to_report() -> None:
    assert perceived(MemoryLog()) == ()
