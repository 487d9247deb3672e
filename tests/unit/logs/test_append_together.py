"""Several streams appended to at a time: each as if alone, whatever becomes of the others."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from event_examples.rows import imu_rows
from trigpoint.errors import AppendFailed, InputError
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.ports import RecallingLog
from trigpoint.logs.verification import verify

STREAMS = ("veh-a", "veh-b", "veh-c")


@pytest.fixture
def log(tmp_path: Path) -> Iterator[McapLog]:
    opened = McapLog(tmp_path / "log")
    yield opened
    opened.close()


@pytest.fixture(params=["files", "memory"])
def any_log(request: pytest.FixtureRequest, log: McapLog) -> RecallingLog:
    return log if request.param == "files" else MemoryLog()


def _count(log: RecallingLog, stream: str) -> int:
    return sum(1 for _ in log.read(stream))


def test_each_stream_has_its_rows_and_tells_where_the_last_stands(any_log: RecallingLog) -> None:
    any_log.append("veh-b", imu_rows(0, 5))
    together = any_log.append_all({"veh-a": imu_rows(0, 3), "veh-b": imu_rows(5, 7)})
    assert {stream: position.number for stream, position in together.positions.items()} == {"veh-a": 2, "veh-b": 6}
    assert (_count(any_log, "veh-a"), _count(any_log, "veh-b"), dict(together.failures)) == (3, 7, {})


def test_a_stream_no_log_can_hold_fails_alone(any_log: RecallingLog) -> None:
    together = any_log.append_all({"veh-a": imu_rows(0, 3), "a/b": imu_rows(0, 3)})
    assert isinstance(together.failures["a/b"], InputError)
    assert (set(together.positions), _count(any_log, "veh-a")) == ({"veh-a"}, 3)


def test_what_the_files_hold_is_what_one_append_after_another_writes(log: McapLog, tmp_path: Path) -> None:
    alone = McapLog(tmp_path / "alone")
    for stream in STREAMS:
        alone.append(stream, imu_rows(0, 40))
    log.append_all({stream: imu_rows(0, 40) for stream in STREAMS})
    alone.close()
    log.close()
    assert [_bytes(tmp_path / "log", stream) for stream in STREAMS] == [
        _bytes(tmp_path / "alone", stream) for stream in STREAMS
    ]


def _bytes(directory: Path, stream: str) -> bytes:
    return (directory / stream / "000000000000.mcap").read_bytes()


def test_a_stream_another_writer_has_fails_alone_and_is_taken_once_that_is_gone(log: McapLog, tmp_path: Path) -> None:
    other = McapLog(tmp_path / "log")
    other.append("veh-b", imu_rows(0, 1))
    refused = log.append_all({"veh-a": imu_rows(0, 3), "veh-b": imu_rows(1, 3)}).failures
    other.close()
    taken = log.append_all({"veh-b": imu_rows(1, 3)})
    assert isinstance(refused["veh-b"], AppendFailed)
    assert (set(refused), taken.positions["veh-b"].number, _count(log, "veh-a")) == ({"veh-b"}, 2, 3)


def test_a_catalog_taken_away_meanwhile_is_filled_again(log: McapLog, tmp_path: Path) -> None:
    log.append_all({stream: imu_rows(0, 4) for stream in STREAMS})
    (tmp_path / "log" / "catalog.sqlite").unlink()
    together = log.append_all({stream: imu_rows(4, 9) for stream in STREAMS})
    assert not together.failures
    assert [_count(log, stream) for stream in STREAMS] == [9, 9, 9]


class Stubborn:
    """Stands in for os.fsync: fails once, and says how often it was called."""

    def __init__(self) -> None:
        self.failed = 0

    def __call__(self, handle: int) -> None:
        if not self.failed:
            self.failed += 1
            raise OSError(5, "no medium")


def test_a_stream_whose_disk_fails_keeps_nothing_of_the_append(
    log: McapLog, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log.append_all({stream: imu_rows(0, 4) for stream in STREAMS})
    stubborn = Stubborn()
    monkeypatch.setattr("trigpoint.logs.stream_writer.os.fsync", stubborn)
    together = log.append_all({stream: imu_rows(4, 9) for stream in STREAMS})
    monkeypatch.undo()
    (failed,) = together.failures
    assert [_count(log, stream) for stream in STREAMS] == [4 if stream == failed else 9 for stream in STREAMS]


def test_after_a_failure_the_same_rows_are_appended_once(
    log: McapLog, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log.append_all({stream: imu_rows(0, 4, vehicle=stream) for stream in STREAMS})
    monkeypatch.setattr("trigpoint.logs.stream_writer.os.fsync", Stubborn())
    failures = log.append_all({stream: imu_rows(4, 9, vehicle=stream) for stream in STREAMS}).failures
    monkeypatch.undo()
    log.append_all({stream: imu_rows(4, 9, vehicle=stream) for stream in failures})
    assert [_count(log, stream) for stream in STREAMS] == [9, 9, 9]
    log.close()
    assert not verify(tmp_path / "log").findings
