"""Loops closed on a log: each pair of drives sought through once, whatever is run again."""

from functools import cache

import pytest

from scanned_worlds.casting import START_NS
from scanned_worlds.drives import scanned_drive
from trigpoint.errors import ServiceError
from trigpoint.events.codec import Event
from trigpoint.events.corrected import DriveExcluded
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.perceived import LoopClosed, LoopsSought
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.readings import logged_drives
from trigpoint.workers import workers
from trigpoint_perception.app import STREAM, perceive_log
from trigpoint_perception.closing import LoopReport, close_loops
from trigpoint_perception.core.closures.settings import ClosureSettings, SubmapSettings

COUNT = 8  # sweeps: 4 m


@cache
def drive_rows(boot_id: str) -> tuple[Envelope[Event], ...]:
    return tuple(scanned_drive("van", COUNT, boot_id=boot_id))


def closed(log: MemoryLog, settings: ClosureSettings | None = None) -> tuple[LoopReport, ...]:
    """What there is perceived, then its loops closed."""
    with workers(threads=2) as some:
        perceive_log(log, lambda: log, some=some)
        return close_loops(log, lambda: log, settings, some=some)


@pytest.fixture(scope="module")
def perceived_rows() -> list[Envelope[Event]]:
    """What is perceived and closed of two drives along one street."""
    log = MemoryLog()
    log.append("veh-van", [*drive_rows("boot-1"), *drive_rows("boot-2")])
    closed(log)
    return [logged.envelope for logged in log.read(STREAM)]


@pytest.fixture
def log(perceived_rows: list[Envelope[Event]]) -> MemoryLog:
    filled = MemoryLog()
    filled.append("veh-van", [*drive_rows("boot-1"), *drive_rows("boot-2")])
    filled.append(STREAM, perceived_rows)
    return filled


def told(log: MemoryLog, kind: type) -> list[Event]:
    return [logged.envelope.event for logged in log.read(STREAM, kinds=(kind,))]


def test_a_street_driven_twice_closes_a_loop(log: MemoryLog) -> None:
    (loop,) = told(log, LoopClosed)
    assert isinstance(loop, LoopClosed)
    assert {loop.boot_id, loop.other_boot_id} == {"boot-1", "boot-2"}
    assert (loop.x_m, loop.y_m, loop.heading_rad) == pytest.approx((0.0, 0.0, 0.0), abs=0.02)  # m: the sweeps' noise


def test_again_nothing_is_said_twice(log: MemoryLog) -> None:
    before = log.next_number(STREAM)
    assert [report.appended for report in closed(log)] == [0, 0]
    assert log.next_number(STREAM) == before


def test_a_search_that_was_cut_short_is_made_again_without_saying_its_loops_twice(log: MemoryLog) -> None:
    rows = [logged.envelope for logged in log.read(STREAM)]
    cut = MemoryLog()
    cut.append("veh-van", [*drive_rows("boot-1"), *drive_rows("boot-2")])
    cut.append(STREAM, [row for row in rows if row.identity != rows[-1].identity])
    assert isinstance(rows[-1].event, LoopsSought)
    closed(cut)
    assert [row.identity for row in rows] == [logged.envelope.identity for logged in cut.read(STREAM)]


def test_a_drive_that_came_since_is_sought_for_alone(log: MemoryLog) -> None:
    log.append("veh-van", drive_rows("boot-3"))
    reports = closed(log)
    assert [report.boot_id for report in reports if report.appended] == ["boot-3"]
    assert (reports[-1].proposed, reports[-1].verified) == (2, 2)


def test_an_excluded_drive_closes_no_loop() -> None:
    log = MemoryLog()
    log.append("veh-van", [*drive_rows("boot-1"), *drive_rows("boot-2")])
    excluded = DriveExcluded(vehicle="van", boot_id="boot-1", author="me", reason="antenna loose")
    log.append("corrections", [Envelope(EventIdentity("cli", "c", 0), START_NS, excluded)])
    assert [(report.boot_id, report.proposed) for report in closed(log)] == [("boot-2", 0)]


def test_a_solve_reads_the_loops_of_a_drive(log: MemoryLog) -> None:
    loops = {drive.boot_id: drive.loops for drive in logged_drives(log)}
    (found,) = (each for each in loops.values() if each.other)
    assert found.motions.covariance.shape == (1, 3, 3)


def test_a_solve_reads_the_loops_that_were_sought_last(log: MemoryLog) -> None:
    closed(log, ClosureSettings(submap=SubmapSettings(span_m=50.0)))
    assert sum(len(drive.loops.other) for drive in logged_drives(log)) == 1


def test_points_that_cannot_be_read_are_named_with_their_drive(log: MemoryLog) -> None:
    log.append("veh-van", drive_rows("boot-3"))
    with workers(threads=1) as some:
        perceive_log(log, lambda: log, some=some)

        def never() -> MemoryLog:
            raise OSError("too many open files")

        with pytest.raises(ServiceError, match="loops of 1 of 1 drives not closed: drive boot-3 of van: too many"):
            close_loops(log, never, some=some)
