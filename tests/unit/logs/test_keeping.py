"""Sealing, retaining and what verification says of both."""

import fcntl
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from event_examples.one_each import ONE_OF_EACH
from event_examples.rows import START_NS, STEP_NS, imu_row, imu_rows
from trigpoint.errors import InputError, LogDamaged
from trigpoint.events.envelope import Envelope, EventIdentity, LogPosition
from trigpoint.events.mapped import MapSolved
from trigpoint.logs.absences import Absence, BootRanges, Reason, record_absences, recorded_absences, uncovered
from trigpoint.logs.following import StreamFollower
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.retention import (
    FRAME_STREAM,
    LOCK_NAME,
    MAP_STREAM,
    Keeping,
    LogFile,
    Obstacle,
    log_files,
    obstacles,
    planned_retention,
    remove_files,
)
from trigpoint.logs.seals import is_sealed, seal_finished
from trigpoint.logs.stream_writer import Rotation
from trigpoint.logs.verification import verify

STREAM = "veh-van"
ROTATION = Rotation(span_ns=99 * STEP_NS, span_least_bytes=0)


@pytest.fixture
def log(tmp_path: Path) -> Iterator[McapLog]:
    """Five files of a hundred events, the last one open."""
    with closing(McapLog(tmp_path / "log", rotation=ROTATION)) as opened:
        for first in range(0, 480, 20):
            opened.append(STREAM, imu_rows(first, first + 20))
        yield opened


@pytest.fixture
def folder(log: McapLog) -> Path:
    seal_finished(log.directory / STREAM)
    return log.directory / STREAM


def _numbers(log: McapLog) -> list[int]:
    return [row.position.number for row in log.read(STREAM)]


def _kinds(log: McapLog) -> set[str]:
    return {finding.kind for finding in verify(log.directory).findings}


def _retained(log: McapLog, passed: int) -> None:
    """Everything before a number gone that may go."""
    held = obstacles(log, {"reader": {STREAM: passed}}, also_inputs=False)
    remove_files(log.directory, planned_retention(log_files(log), held, Keeping(total_bytes=0)).removed)


def test_finished_files_are_sealed_and_the_one_being_written_is_not(folder: Path) -> None:
    sealed = {path.name: is_sealed(path) for path in sorted(folder.glob("*.mcap"))}
    assert list(sealed.values()) == [True, True, True, True, False]


def test_a_seal_is_what_sha256sum_checks(folder: Path) -> None:
    command = ["sha256sum", "--check", "--quiet", "000000000100.mcap.sha256"]
    assert subprocess.run(command, cwd=folder, check=False).returncode == 0


def test_a_damaged_file_is_not_sealed_and_the_others_are(log: McapLog) -> None:
    path = log.directory / STREAM / "000000000100.mcap"
    content = bytearray(path.read_bytes())
    content[500] ^= 1
    path.write_bytes(content)
    sealing = seal_finished(path.parent)
    assert len(sealing.sealed) == 3
    assert "000000000100.mcap" in sealing.faults[0]


def test_a_file_that_is_whole_but_not_what_was_sealed_is_found(log: McapLog, folder: Path, tmp_path: Path) -> None:
    log.close()
    with closing(McapLog(tmp_path / "other", rotation=ROTATION)) as other:
        other.append(STREAM, [imu_row(number, boot_id="other") for number in range(100)])
    (folder / "000000000000.mcap").write_bytes((tmp_path / "other" / STREAM / "000000000000.mcap").read_bytes())
    assert "broken seal" in _kinds(log)


def test_a_flipped_bit_of_a_seal_is_found(log: McapLog, folder: Path) -> None:
    log.close()
    seal = folder / "000000000000.mcap.sha256"
    content = bytearray(seal.read_bytes())
    content[-1] ^= 1
    seal.write_bytes(content)
    assert _kinds(log) == {"broken seal"}


def test_a_sealed_file_that_is_gone_is_found_without_a_catalog(log: McapLog, folder: Path) -> None:
    log.close()
    (log.directory / "catalog.sqlite").unlink()
    (folder / "000000000400.mcap").rename(folder.parent / "away")
    (folder / "000000000300.mcap").rename(folder.parent / "away")
    assert _kinds(log) == {"missing file"}


def test_abandoned_files_are_ended_and_those_being_written_are_not(log: McapLog) -> None:
    log.append("veh-car", imu_rows(0, 3, vehicle="car"))
    with closing(McapLog(log.directory)) as other:
        assert other.end_abandoned() == ("veh-car", STREAM)
    assert log.end_abandoned() == ("veh-car", STREAM)
    assert not log.contents("veh-car")[0].file.finished


def test_a_file_open_for_long_enough_is_ended_whatever_its_events_times(tmp_path: Path) -> None:
    with closing(McapLog(tmp_path, rotation=Rotation(age_ns=100))) as log:
        log.append(STREAM, [imu_row(0)])
        assert [log.end_aged(now_ns) for now_ns in (1000, 1099, 1100, 1200)] == [(), (), (STREAM,), ()]
        assert log.contents(STREAM)[0].file.finished
        assert log.append(STREAM, [imu_row(1)]) == LogPosition(STREAM, 1)


def test_retained_files_are_gone_and_numbers_go_on(log: McapLog, folder: Path) -> None:
    _retained(log, 250)
    assert (log.begins_at(STREAM), _numbers(log)) == (200, list(range(200, 480)))
    assert log.append(STREAM, [imu_row(480)]) == LogPosition(STREAM, 480)


def test_verification_says_what_was_retained_away_and_finds_nothing_wrong(log: McapLog, folder: Path) -> None:
    _retained(log, 250)
    log.close()
    verification = verify(log.directory)
    assert verification.findings == ()
    assert [(absence.first_number, absence.stop_number) for _, absence in verification.absences] == [
        (0, 100),
        (100, 200),
    ]


def test_what_was_retained_away_is_remembered_by_identity_and_time(log: McapLog, folder: Path) -> None:
    _retained(log, 100)
    assert log.absences(STREAM) == (
        Absence(
            first_number=0,
            stop_number=100,
            reason=Reason.RETAINED,
            start_ns=START_NS,
            end_ns=START_NS + 99 * STEP_NS,
            boots=(BootRanges("van", "boot-1", ((0, 100),)),),
        ),
    )


def test_numbers_go_on_where_every_file_was_retained_away(log: McapLog, folder: Path) -> None:
    log.close()
    seal_finished(folder)
    with closing(McapLog(log.directory)) as again:
        _retained(again, 480)
        assert (again.next_number(STREAM), again.begins_at(STREAM), _numbers(again)) == (480, 480, [])
        assert again.append(STREAM, [imu_row(480)]) == LogPosition(STREAM, 480)


def test_what_cannot_be_recorded_is_not_taken_away(log: McapLog, folder: Path) -> None:
    (folder / "absences.jsonl").write_text("rubbish\n")
    with pytest.raises(LogDamaged, match=r"absences\.jsonl, line 1"):
        _retained(log, 250)
    assert (folder / "000000000000.mcap").exists()


def test_a_file_that_is_not_what_was_sealed_is_not_taken_away(log: McapLog, folder: Path) -> None:
    path = folder / "000000000100.mcap"
    content = bytearray(path.read_bytes())
    content[500] ^= 1
    path.write_bytes(content)
    with pytest.raises(LogDamaged, match=r"000000000100\.mcap: is not what was sealed"):
        _retained(log, 250)
    assert recorded_absences(folder) == ()


def test_an_interrupted_removal_is_finished_by_the_next(log: McapLog, folder: Path) -> None:
    before = (folder / "000000000000.mcap").read_bytes()
    seal = (folder / "000000000000.mcap.sha256").read_bytes()
    _retained(log, 100)
    (folder / "000000000000.mcap").write_bytes(before)
    (folder / "000000000000.mcap.sha256").write_bytes(seal)
    _retained(log, 100)
    assert not (folder / "000000000000.mcap").exists()
    assert len(recorded_absences(folder)) == 1


def test_a_reader_overtaken_by_retention_is_told_which_numbers_are_gone(log: McapLog, folder: Path) -> None:
    reading = log.read(STREAM)
    next(reading)
    _retained(log, 300)
    with pytest.raises(LogDamaged, match="numbers 100 to 199 were taken away while the stream was read"):
        list(reading)


def test_a_follower_goes_on_behind_what_was_retained_away(log: McapLog, folder: Path) -> None:
    _retained(log, 250)
    taken = StreamFollower(log, [STREAM]).take(5)
    assert [row.position.number for row in taken] == [200, 201, 202, 203, 204]


def test_another_process_s_reader_sees_files_come_and_go(log: McapLog, folder: Path) -> None:
    with closing(McapLog(log.directory)) as reader:
        assert len(_numbers(reader)) == 480
        _retained(log, 250)
        log.append(STREAM, imu_rows(480, 580))
        assert _numbers(reader) == list(range(200, 580))


def _files(*, sealed: Sequence[bool] = (True, True, True)) -> dict[str, list[LogFile]]:
    """Three files of ten events and a hundred bytes each, a second of measurements in each."""
    return {
        STREAM: [
            LogFile(
                stream=STREAM,
                first_number=10 * index,
                stop_number=10 * index + 10,
                size_bytes=100,
                start_ns=1000 * index,
                end_ns=1000 * index + 999,
                sealed=is_one,
            )
            for index, is_one in enumerate(sealed)
        ]
    }


FREE = {STREAM: Obstacle(30, "")}


def test_files_older_than_asked_for_go() -> None:
    plan = planned_retention(_files(), FREE, Keeping(newer_than_ns=2000))
    assert [file.first_number for file in plan.removed] == [0, 10]
    assert plan.kept_because == ((STREAM, "it is young enough"),)


def test_the_oldest_files_go_until_the_rest_is_small_enough() -> None:
    plan = planned_retention(_files(), FREE, Keeping(total_bytes=250))
    assert [file.first_number for file in plan.removed] == [0]
    assert (plan.freed_bytes, plan.total_bytes) == (100, 300)


def test_a_file_that_is_not_sealed_stays_with_all_behind_it() -> None:
    plan = planned_retention(_files(sealed=(True, False, True)), FREE, Keeping(total_bytes=0))
    assert [file.first_number for file in plan.removed] == [0]
    assert plan.kept_because == ((STREAM, "file 10 is not sealed"),)


def test_a_file_some_reader_has_not_passed_stays() -> None:
    plan = planned_retention(
        _files(), {STREAM: Obstacle(19, "x has passed it up to number 19 only")}, Keeping(total_bytes=0)
    )
    assert [file.first_number for file in plan.removed] == [0]
    assert plan.kept_because == ((STREAM, "x has passed it up to number 19 only"),)


def test_the_slowest_reader_holds_a_stream_and_nobody_s_word_holds_it_whole(log: McapLog) -> None:
    passed = {"fast": {STREAM: 400}, "slow": {STREAM: 120}}
    assert obstacles(log, passed, also_inputs=False)[STREAM] == Obstacle(
        120, "slow has passed it up to number 120 only"
    )
    assert obstacles(log, {}, also_inputs=False)[STREAM] == Obstacle(0, "no checkpoint names it")


@pytest.fixture
def solved(log: McapLog) -> McapLog:
    """A log with a map version made from 300 events of the van."""
    (head,) = [row.event for row in ONE_OF_EACH if isinstance(row.event, MapSolved)]
    event = replace(head, inputs=((STREAM, 300),), base_version=0)
    log.append(MAP_STREAM, [Envelope(EventIdentity("optimisation", "1", 0), START_NS, event)])
    return log


def test_what_the_newest_map_was_solved_from_stays_unless_told_otherwise(solved: McapLog) -> None:
    passed = {"reader": {STREAM: 400, MAP_STREAM: 1}}
    assert obstacles(solved, passed, also_inputs=False)[STREAM].number == 0
    assert obstacles(solved, passed, also_inputs=True)[STREAM].number == 400


def test_the_newest_map_version_and_the_frame_always_stay(solved: McapLog) -> None:
    passed = {"reader": {STREAM: 400, MAP_STREAM: 1, FRAME_STREAM: 1}}
    held = obstacles(solved, passed, also_inputs=True)
    assert (held[MAP_STREAM].number, held[FRAME_STREAM].number) == (0, 0)


@pytest.mark.parametrize("at", range(0, 200, 7))
def test_any_flipped_bit_of_the_record_of_absences_is_found(tmp_path: Path, at: int) -> None:
    record_absences(tmp_path, [Absence(first_number=0, stop_number=9, reason=Reason.LOST, end_ns=2**60)] * 2)
    path = tmp_path / "absences.jsonl"
    content = bytearray(path.read_bytes())
    content[at] ^= 1 << (at % 8)
    path.write_bytes(content)
    with pytest.raises(LogDamaged, match="absences"):
        recorded_absences(tmp_path)


def test_what_no_absence_accounts_for_is_left() -> None:
    gone = [
        Absence(first_number=2, stop_number=4, reason=Reason.LOST),
        Absence(first_number=6, stop_number=8, reason=Reason.LOST),
    ]
    assert uncovered([(0, 10)], gone) == ((0, 2), (4, 6), (8, 10))
    assert uncovered([(2, 4), (7, 7)], gone) == ()


def test_while_another_process_takes_files_away_nothing_goes_and_afterwards_it_does(log: McapLog, folder: Path) -> None:
    with (log.directory / LOCK_NAME).open("ab") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with pytest.raises(InputError, match="one at a time"):
            _retained(log, 250)
        assert recorded_absences(folder) == ()
    _retained(log, 250)
    assert [absence.first_number for absence in recorded_absences(folder)] == [0, 100]
