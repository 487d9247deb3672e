from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from event_examples.any_event import same_event
from event_examples.one_each import ONE_OF_EACH
from event_examples.rows import START_NS, STEP_NS, fix_row, imu_row, imu_rows
from trigpoint.errors import InputError
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, EventIdentity, LogPosition
from trigpoint.events.observed import GnssFixReceived, ImuMeasured
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.ports import EventLog, LoggedBoot

STREAM = "veh-van"


def _in_memory(_: Path) -> EventLog:
    return MemoryLog()


def _on_disk(directory: Path) -> EventLog:
    return McapLog(directory)


@pytest.fixture(params=[_in_memory, _on_disk], ids=["memory", "mcap"])
def log(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[EventLog]:
    make: Callable[[Path], EventLog] = request.param
    opened = make(tmp_path / "log")
    yield opened
    opened.close()


def test_the_position_of_the_last_row_is_returned(log: EventLog) -> None:
    assert log.append(STREAM, imu_rows(0, 3)) == LogPosition(STREAM, 2)


def test_numbers_go_on_from_append_to_append(log: EventLog) -> None:
    log.append(STREAM, imu_rows(0, 3))
    assert log.append(STREAM, imu_rows(3, 5)) == LogPosition(STREAM, 4)
    assert log.next_number(STREAM) == 5


def test_events_are_read_in_order_of_appending_not_of_time(log: EventLog) -> None:
    rows = [imu_row(5), imu_row(1), imu_row(3)]
    log.append(STREAM, rows)
    assert [logged.envelope for logged in log.read(STREAM)] == rows


def test_positions_count_from_zero_without_gaps(log: EventLog) -> None:
    log.append(STREAM, imu_rows(0, 2))
    log.append(STREAM, imu_rows(2, 4))
    assert [logged.position for logged in log.read(STREAM)] == [LogPosition(STREAM, number) for number in range(4)]


def test_reading_starts_at_the_number_asked_for(log: EventLog) -> None:
    log.append(STREAM, imu_rows(0, 4))
    log.append(STREAM, imu_rows(4, 8))
    assert [logged.position.number for logged in log.read(STREAM, first_number=3)] == [3, 4, 5, 6, 7]


def test_reading_beyond_the_end_gives_nothing(log: EventLog) -> None:
    log.append(STREAM, imu_rows(0, 4))
    assert list(log.read(STREAM, first_number=4)) == []


def test_a_time_range_holds_its_start_and_not_its_end(log: EventLog) -> None:
    log.append(STREAM, imu_rows(0, 10))
    found = log.read(STREAM, from_ns=START_NS + 2 * STEP_NS, until_ns=START_NS + 5 * STEP_NS)
    assert [logged.envelope.identity.sequence for logged in found] == [2, 3, 4]


def test_a_time_range_keeps_the_numbers_of_its_events(log: EventLog) -> None:
    log.append(STREAM, imu_rows(0, 10))
    found = log.read(STREAM, from_ns=START_NS + 7 * STEP_NS)
    assert [logged.position.number for logged in found] == [7, 8, 9]


def test_only_the_kinds_asked_for_are_read(log: EventLog) -> None:
    log.append(STREAM, [imu_row(0), fix_row(1), imu_row(2)])
    found = list(log.read(STREAM, kinds=[GnssFixReceived]))
    assert [(logged.position.number, type(logged.envelope.event)) for logged in found] == [(1, GnssFixReceived)]


def test_no_kinds_at_all_read_nothing(log: EventLog) -> None:
    log.append(STREAM, imu_rows(0, 3))
    assert list(log.read(STREAM, kinds=[])) == []


def test_several_kinds_are_read_together(log: EventLog) -> None:
    log.append(STREAM, [imu_row(0), fix_row(1)])
    assert len(list(log.read(STREAM, kinds=[GnssFixReceived, ImuMeasured]))) == 2


@pytest.mark.parametrize("row", ONE_OF_EACH, ids=lambda row: type(row.event).__name__)
def test_every_class_of_events_comes_back(log: EventLog, row: Envelope[Event]) -> None:
    log.append("some", [row])
    (logged,) = log.read("some")
    assert same_event(logged.envelope.event, row.event)
    assert (logged.envelope.identity, logged.envelope.stamp_ns) == (row.identity, row.stamp_ns)


def test_sources_and_boots_are_kept_apart(log: EventLog) -> None:
    rows = [imu_row(0, boot_id="boot-1"), imu_row(0, boot_id="boot-2"), imu_row(0, vehicle="car")]
    log.append(STREAM, rows)
    assert [logged.envelope.identity for logged in log.read(STREAM)] == [row.identity for row in rows]


def test_sequences_beyond_32_bits_come_back(log: EventLog) -> None:
    rows = [_numbered(2**32 - 1), _numbered(2**32), _numbered(2**32 + 1)]
    log.append(STREAM, rows)
    found = [logged.envelope.identity.sequence for logged in log.read(STREAM)]
    assert found == [2**32 - 1, 2**32, 2**32 + 1]


def _numbered(sequence: int) -> Envelope[Event]:
    return Envelope(EventIdentity("van", "boot-1", sequence), START_NS, imu_row(0).event)


def test_names_in_any_script_come_back(log: EventLog) -> None:
    row = imu_row(0, vehicle="車両一")
    log.append("veh-車両一", [row])
    assert [logged.envelope for logged in log.read("veh-車両一")] == [row]


def test_streams_are_named_in_order(log: EventLog) -> None:
    log.append("veh-b", imu_rows(0, 1))
    log.append("veh-a", imu_rows(0, 1))
    assert log.streams() == ("veh-a", "veh-b")


def test_an_unknown_stream_is_empty(log: EventLog) -> None:
    assert list(log.read("nowhere")) == []
    assert log.next_number("nowhere") == 0


def test_appending_nothing_names_the_last_event_there(log: EventLog) -> None:
    log.append(STREAM, imu_rows(0, 3))
    assert log.append(STREAM, []) == LogPosition(STREAM, 2)


def test_what_is_appended_while_reading_is_not_read(log: EventLog) -> None:
    log.append(STREAM, imu_rows(0, 2))
    reading = log.read(STREAM)
    next(reading)
    log.append(STREAM, imu_rows(2, 4))
    assert [logged.position.number for logged in reading] == [1]


@pytest.mark.parametrize("name", ["", "a/b", "..", "a\0", "x" * 256])
def test_a_stream_no_folder_can_have_is_refused(log: EventLog, name: str) -> None:
    with pytest.raises(InputError):
        log.append(name, imu_rows(0, 1))


@pytest.mark.parametrize("stamp_ns", [-1, 2**63])
def test_a_stamp_no_file_can_hold_is_refused_and_named(log: EventLog, stamp_ns: int) -> None:
    row = Envelope(EventIdentity("van", "boot-1", 0), stamp_ns, imu_row(0).event)
    with pytest.raises(InputError, match=str(stamp_ns)):
        log.append(STREAM, [row])


def test_of_a_batch_with_one_bad_row_nothing_is_appended(log: EventLog) -> None:
    bad = Envelope(EventIdentity("van", "boot-1", 1), -1, imu_row(1).event)
    with pytest.raises(InputError):
        log.append(STREAM, [imu_row(0), bad])
    assert log.next_number(STREAM) == 0


def test_a_name_that_is_no_unicode_is_refused(log: EventLog) -> None:
    row = imu_row(0, vehicle="\ud800")
    with pytest.raises(InputError):
        log.append(STREAM, [row])


def test_the_longest_name_of_a_vehicle_makes_a_stream(log: EventLog) -> None:
    vehicle = "車" * 60  # 180 bytes: the longest name allowed, of characters of three bytes
    assert log.append(f"veh-{vehicle}", [imu_row(0, vehicle=vehicle)]).number == 0


def test_a_streams_boots_come_with_times_that_hold_all_their_events(log: EventLog) -> None:
    later = [replace(row, identity=replace(row.identity, boot_id="boot-2")) for row in imu_rows(5, 8)]
    log.append(STREAM, imu_rows(0, 3))
    log.append(STREAM, later)
    stamps_ns = [START_NS + n * STEP_NS for n in (0, 2, 5, 7)]
    boot_id = imu_row(0).identity.boot_id
    assert log.boots(STREAM) == (
        LoggedBoot("van", boot_id, stamps_ns[0], stamps_ns[1]),
        LoggedBoot("van", "boot-2", stamps_ns[2], stamps_ns[3]),
    )


def test_an_unknown_stream_has_no_boots(log: EventLog) -> None:
    assert log.boots(STREAM) == ()
