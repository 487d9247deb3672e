"""Loops of drives near and far: those that cannot have met are not compared, and nothing is lost by it."""

from collections.abc import Iterator, Sequence
from typing import Any

import pytest

from scanned_worlds.casting import OTHER_STREET, START_NS, STREET
from scanned_worlds.drives import scanned_drive
from trigpoint.errors import LogDamaged
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import GnssFixReceived
from trigpoint.events.perceived import LoopClosed, LoopsSought
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.ports import LoggedEvent
from trigpoint.workers import workers
from trigpoint_perception.app import STREAM, perceive_log
from trigpoint_perception.closing import LoopReport, close_loops

Driven = tuple[list[Envelope[Event]], list[Envelope[Event]]]

COUNT = 8  # sweeps: 4 m
DRIVES = {"there": STREET, "again": STREET, "elsewhere": OTHER_STREET, "unknown": STREET}  # by boot, all begin at once
NORTH_M = {"there": -60.0, "again": 60.0, "elsewhere": 20_000.0}  # of fixes: bad ones of one street, and of a town away
DEGREE_M = 111_195.0  # of latitude


class WithoutFixes(MemoryLog):
    """A log whose fixes cannot be read."""

    def read(self, stream: str, *, kinds: Sequence[type] | None = None, **more: Any) -> Iterator[LoggedEvent]:
        if kinds == (GnssFixReceived,):
            raise LogDamaged(f"{stream}: chunk 3 is cut short")
        return super().read(stream, kinds=kinds, **more)


def fix(boot_id: str) -> Envelope[Event]:
    """A fix in the middle of a drive."""
    lat_deg = -33.89 + NORTH_M[boot_id] / DEGREE_M
    event = GnssFixReceived(lat_deg=lat_deg, lon_deg=151.19, height_m=0.0, sigma_m=2.0)
    return Envelope(EventIdentity("van", boot_id, 1000), START_NS + 400_000_000, event)


@pytest.fixture(scope="module")
def driven() -> Driven:
    """The drives without their fixes, and what is perceived of them."""
    rows = [
        row for boot_id, street in DRIVES.items() for row in scanned_drive("van", COUNT, boot_id=boot_id, world=street)
    ]
    log = MemoryLog()
    log.append("veh-van", rows)
    with workers(threads=1) as some:
        perceive_log(log, lambda: log, some=some)
    return rows, [logged.envelope for logged in log.read(STREAM)]


def filled(log: MemoryLog, driven: Driven, *, fixed: bool) -> MemoryLog:
    rows, perceived = driven
    log.append("veh-van", [*rows, *(fix(boot_id) for boot_id in NORTH_M if fixed)])
    log.append(STREAM, perceived)
    return log


def closed(log: MemoryLog) -> dict[str, LoopReport]:
    with workers(threads=1) as some:
        return {report.boot_id: report for report in close_loops(log, lambda: log, some=some)}


def loops(log: MemoryLog) -> list[Envelope[Any]]:
    return [logged.envelope for logged in log.read(STREAM, kinds=(LoopClosed,))]


@pytest.fixture(scope="module")
def passed_over(driven: Driven) -> MemoryLog:
    """The log with fixes, its loops closed."""
    log = filled(MemoryLog(), driven, fixed=True)
    closed(log)
    return log


def test_the_same_loops_are_closed_as_where_every_drive_is_compared(driven: Driven, passed_over: MemoryLog) -> None:
    every = filled(MemoryLog(), driven, fixed=False)
    reports = closed(every)
    assert [report.drives_apart for report in reports.values()] == [0, 0, 0, 0]
    pairs = {frozenset((row.event.boot_id, row.event.other_boot_id)) for row in loops(every)}
    assert pairs == {frozenset(pair) for pair in (("there", "again"), ("there", "unknown"), ("again", "unknown"))}
    assert [row.identity for row in loops(passed_over)] == [row.identity for row in loops(every)]
    assert list(map(told, loops(passed_over))) == list(map(told, loops(every)))


def told(row: Envelope[LoopClosed]) -> tuple[object, ...]:
    loop = row.event
    return row.stamp_ns, loop.sweep_sequence, loop.other_sequence, loop.x_m, loop.y_m, loop.heading_rad, loop.pairs


def test_only_drives_that_may_have_met_are_compared(passed_over: MemoryLog) -> None:
    searches = [logged.envelope.event for logged in passed_over.read(STREAM, kinds=(LoopsSought,))]
    among = {
        search.boot_id: [each.boot_id for each in search.among]
        for search in searches
        if isinstance(search, LoopsSought)
    }
    assert among == {
        "there": ["there"],
        "again": ["there", "again"],
        "elsewhere": ["elsewhere"],
        "unknown": ["there", "again", "elsewhere", "unknown"],
    }


def test_again_nothing_is_said_and_those_passed_over_are_counted_as_before(passed_over: MemoryLog) -> None:
    before = passed_over.next_number(STREAM)
    reports = closed(passed_over)
    counts = {boot_id: report.drives_apart for boot_id, report in reports.items()}
    assert counts == {"there": 0, "again": 0, "elsewhere": 2, "unknown": 0}
    assert passed_over.next_number(STREAM) == before


def test_drives_whose_fixes_cannot_be_read_are_compared_with_all_and_that_is_said(
    driven: Driven, caplog: pytest.LogCaptureFixture
) -> None:
    reports = closed(filled(WithoutFixes(), driven, fixed=True))
    assert [report.drives_apart for report in reports.values()] == [0, 0, 0, 0]
    assert "veh-van: chunk 3 is cut short" in caplog.text
