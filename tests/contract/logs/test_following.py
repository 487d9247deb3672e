from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from event_examples.rows import fix_row, imu_rows
from trigpoint.errors import LogDamaged
from trigpoint.events.observed import GnssFixReceived
from trigpoint.logs.following import StreamFollower
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.ports import EventLog, LoggedEvent


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


def _positions(rows: list[LoggedEvent]) -> list[tuple[str, int]]:
    return [(row.position.stream, row.position.number) for row in rows]


def test_what_is_there_is_taken_once(log: EventLog) -> None:
    log.append("veh-van", imu_rows(0, 3))
    follower = StreamFollower(log, ["veh-van"])
    assert _positions(follower.take(10)) == [("veh-van", 0), ("veh-van", 1), ("veh-van", 2)]
    assert follower.take(10) == []


def test_what_is_appended_later_is_taken_then(log: EventLog) -> None:
    log.append("veh-van", imu_rows(0, 3))
    follower = StreamFollower(log, ["veh-van"])
    follower.take(10)
    log.append("veh-van", imu_rows(3, 5))
    assert _positions(follower.take(10)) == [("veh-van", 3), ("veh-van", 4)]


def test_a_limit_cuts_and_the_next_take_goes_on_there(log: EventLog) -> None:
    log.append("veh-van", imu_rows(0, 5))
    follower = StreamFollower(log, ["veh-van"])
    assert [len(follower.take(2)), len(follower.take(2)), len(follower.take(2)), len(follower.take(2))] == [2, 2, 1, 0]


def test_following_goes_on_from_a_checkpoint(log: EventLog) -> None:
    log.append("veh-van", imu_rows(0, 5))
    first = StreamFollower(log, ["veh-van"])
    first.take(3)
    again = StreamFollower(log, ["veh-van"], checkpoint=first.checkpoint)
    assert _positions(again.take(10)) == [("veh-van", 3), ("veh-van", 4)]


def test_streams_not_named_are_left_alone(log: EventLog) -> None:
    log.append("veh-van", imu_rows(0, 1))
    log.append("other", imu_rows(0, 1))
    assert _positions(StreamFollower(log, ["veh-van"]).take(10)) == [("veh-van", 0)]


def test_a_stream_that_appears_later_is_followed(log: EventLog) -> None:
    follower = StreamFollower(log, lambda stream: stream.startswith("veh-"))
    assert follower.take(10) == []
    log.append("veh-car", imu_rows(0, 2))
    assert _positions(follower.take(10)) == [("veh-car", 0), ("veh-car", 1)]


def test_no_stream_starves_behind_a_long_one(log: EventLog) -> None:
    log.append("veh-a", imu_rows(0, 100))
    log.append("veh-b", imu_rows(0, 1))
    follower = StreamFollower(log, ["veh-a", "veh-b"])
    follower.take(2)
    assert ("veh-b", 0) in _positions(follower.take(2))


def test_events_of_other_kinds_are_passed_over_and_not_looked_at_again(log: EventLog) -> None:
    log.append("veh-van", [*imu_rows(0, 3), fix_row(3), *imu_rows(4, 6)])
    follower = StreamFollower(log, ["veh-van"], kinds=[GnssFixReceived])
    assert _positions(follower.take(10)) == [("veh-van", 3)]
    assert follower.checkpoint == {"veh-van": 6}


def test_the_lag_counts_what_was_not_taken(log: EventLog) -> None:
    log.append("veh-van", imu_rows(0, 5))
    follower = StreamFollower(log, ["veh-van"])
    follower.take(2)
    assert follower.lag == 3


def test_another_process_s_log_is_followed_while_it_grows(tmp_path: Path) -> None:
    with closing(McapLog(tmp_path)) as writer, closing(McapLog(tmp_path)) as reader:
        follower = StreamFollower(reader, ["veh-van"])
        writer.append("veh-van", imu_rows(0, 3))
        assert len(follower.take(10)) == 3
        writer.append("veh-van", imu_rows(3, 5))
        assert _positions(follower.take(10)) == [("veh-van", 3), ("veh-van", 4)]


def test_damage_is_raised_after_everything_before_it_was_taken(tmp_path: Path) -> None:
    with closing(McapLog(tmp_path)) as log:
        log.append("veh-van", imu_rows(0, 3))
        log.append("veh-van", imu_rows(3, 5))
        path = tmp_path / "veh-van" / "000000000000.mcap"
        content = bytearray(path.read_bytes())
        content[content.rfind(b"zstd") + 30] ^= 1
        path.write_bytes(content)
        follower = StreamFollower(log, ["veh-van"])
        assert len(follower.take(10)) == 3
        with pytest.raises(LogDamaged, match="2 messages lost"):
            follower.take(10)
        assert follower.checkpoint == {"veh-van": 3}


def test_damage_to_one_stream_does_not_hold_up_the_others(tmp_path: Path) -> None:
    with closing(McapLog(tmp_path)) as log:
        log.append("veh-a", imu_rows(0, 3))
        log.append("veh-b", imu_rows(0, 2))
        path = tmp_path / "veh-a" / "000000000000.mcap"
        path.write_bytes(path.read_bytes()[:200])
        follower = StreamFollower(log, ["veh-a", "veh-b"])
        with pytest.raises(LogDamaged):
            follower.take(10)
        assert _positions(follower.take(10)) == [("veh-b", 0), ("veh-b", 1)]
