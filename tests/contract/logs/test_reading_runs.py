"""Events read many at once, undecoded: the same ones that are read one by one."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from pathlib import Path

import pytest

from event_examples.rows import fix_row, imu_row, imu_rows
from trigpoint.errors import LogDamaged
from trigpoint.events.envelope import LogPosition
from trigpoint.events.observed import GnssFixReceived, ImuMeasured
from trigpoint.events.runs import LoggedRun, envelopes
from trigpoint.logs.as_of import LogAsOf
from trigpoint.logs.following import RunFollower
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.ports import EventLog, LoggedEvent
from trigpoint.logs.stream_writer import Rotation

STREAM = "veh-van"
ROWS = [
    *(imu_row(sequence) if sequence % 5 else fix_row(sequence) for sequence in range(400)),
    *(imu_row(sequence, boot_id="boot-2") for sequence in range(30)),
    *(imu_row(2**32 - 2 + sequence) for sequence in range(4)),
]


def _in_memory(_: Path) -> EventLog:
    return MemoryLog()


def _on_disk(directory: Path) -> EventLog:
    return McapLog(directory, rotation=Rotation(size_bytes=5_000))


@pytest.fixture(params=[_in_memory, _on_disk], ids=["memory", "mcap"])
def log(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[EventLog]:
    """A log of events of two kinds and boots, appended 60 at a time."""
    make: Callable[[Path], EventLog] = request.param
    with closing(make(tmp_path / "log")) as opened:
        for first in range(0, len(ROWS), 60):
            opened.append(STREAM, ROWS[first : first + 60])
        yield opened


def events_of(runs: Sequence[LoggedRun] | Iterator[LoggedRun]) -> list[LoggedEvent]:
    return [
        LoggedEvent(LogPosition(run.position.stream, run.position.number + index), envelope)
        for run in runs
        for index, envelope in enumerate(envelopes(run.run))
    ]


@pytest.mark.parametrize("first_number", [0, 1, 59, 60, 250, 433, 434, 1000])
def test_runs_hold_the_events_from_a_number_on(log: EventLog, first_number: int) -> None:
    runs = events_of(log.read_runs(STREAM, first_number=first_number))
    assert runs == list(log.read(STREAM, first_number=first_number))


@pytest.mark.parametrize("kinds", [(ImuMeasured,), (GnssFixReceived,), ()])
def test_runs_hold_the_kinds_asked_for(log: EventLog, kinds: tuple[type, ...]) -> None:
    assert events_of(log.read_runs(STREAM, kinds=kinds)) == list(log.read(STREAM, kinds=kinds))


def test_runs_of_a_log_as_it_was_end_where_it_did(log: EventLog) -> None:
    was = LogAsOf(log, ((STREAM, 130),))
    assert events_of(was.read_runs(STREAM, first_number=50)) == list(was.read(STREAM, first_number=50))


def test_a_stream_nobody_wrote_has_no_runs(log: EventLog) -> None:
    assert list(log.read_runs("veh-nobody")) == []


def test_events_are_taken_once_each_and_no_more_than_wanted(log: EventLog) -> None:
    follower = RunFollower(log, STREAM)
    taken = [follower.take(150) for _ in range(4)]
    assert [sum(len(row.run) for row in rows) for rows in taken] == [150, 150, 134, 0]
    assert events_of([row for rows in taken for row in rows]) == list(log.read(STREAM))


def test_what_is_appended_later_is_taken_later(log: EventLog) -> None:
    follower = RunFollower(log, STREAM, first_number=len(ROWS))
    assert follower.take(10) == []
    log.append(STREAM, imu_rows(1000, 1003))
    assert [row.position.number for row in events_of(follower.take(10))] == [434, 435, 436]
    assert not follower.is_behind


def test_large_events_are_taken_fewer_at_a_time(log: EventLog) -> None:
    follower = RunFollower(log, STREAM)
    (first, *others) = follower.take(400, limit_bytes=1)
    assert (first.position.number, others, follower.is_behind) == (0, [], True)


def test_damage_is_raised_after_every_run_before_it_was_taken(tmp_path: Path) -> None:
    with closing(McapLog(tmp_path)) as log:
        log.append(STREAM, imu_rows(0, 3))
        log.append(STREAM, imu_rows(3, 5))
        path = tmp_path / STREAM / "000000000000.mcap"
        content = bytearray(path.read_bytes())
        content[content.rfind(b"zstd") + 30] ^= 1
        path.write_bytes(content)
        follower = RunFollower(log, STREAM)
        assert len(events_of(follower.take(10))) == 3
        with pytest.raises(LogDamaged, match="2 messages lost"):
            follower.take(10)
