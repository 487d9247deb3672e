"""The log as it was when a map version was solved."""

import pytest

from event_examples.rows import START_NS, STEP_NS, fix_row, imu_row, imu_rows
from trigpoint.errors import AppendFailed
from trigpoint.events.observed import GnssFixReceived
from trigpoint.logs.as_of import LogAsOf
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.ports import LoggedBoot

VAN, CAR = "veh-van", "veh-car"


def as_of(*inputs: tuple[str, int]) -> LogAsOf:
    """Four events of the van, with a second boot in the last two, and two of a car."""
    log = MemoryLog()
    log.append(VAN, [imu_row(0), fix_row(1), imu_row(0, boot_id="boot-2"), fix_row(1, boot_id="boot-2")])
    log.append(CAR, imu_rows(0, 2, vehicle="car"))
    return LogAsOf(log, inputs)


def test_events_appended_since_are_not_there() -> None:
    log = as_of((VAN, 3), (CAR, 0))
    assert [row.position.number for row in log.read(VAN)] == [0, 1, 2]
    assert log.next_number(VAN) == 3


def test_a_stream_that_was_not_read_holds_nothing() -> None:
    log = as_of((VAN, 3))
    assert (list(log.read(CAR)), log.streams(), log.next_number(CAR)) == ([], (VAN,), 0)


def test_filters_hold_within_what_there_was() -> None:
    found = as_of((VAN, 3)).read(VAN, first_number=1, kinds=(GnssFixReceived,), until_ns=START_NS + 9 * STEP_NS)
    assert [row.position.number for row in found] == [1]


def test_a_boot_begun_since_is_not_there() -> None:
    assert as_of((VAN, 2)).boots(VAN) == (LoggedBoot("van", "boot-1", START_NS, START_NS + STEP_NS),)


def test_nothing_can_be_appended() -> None:
    with pytest.raises(AppendFailed, match="2 rows for a log as it was"):
        as_of((VAN, 2)).append(VAN, imu_rows(2, 4))
