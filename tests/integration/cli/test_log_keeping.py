"""`trigpoint log seal|retain|recover|verify` on a log of known events."""

import json
import shutil
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path

import pytest

from command_runs.running import trigpoint
from event_examples.rows import STEP_NS, imu_rows
from trigpoint.configuration.sections import LogSettings
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.stream_writer import Rotation
from trigpoint_cli.serving.resources import rotation_of
from trigpoint_cli.serving.sealing import seal_written

STREAM = "veh-van"
ROTATION = Rotation(span_ns=99 * STEP_NS, span_least_bytes=0, age_ns=1000)


def _write(log: McapLog) -> None:
    for first in range(0, 480, 20):
        log.append(STREAM, imu_rows(first, first + 20))


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A data directory with a log of five files, closed."""
    with closing(McapLog(tmp_path / "data" / "log", rotation=ROTATION)) as log:
        _write(log)
    return tmp_path / "data"


@pytest.fixture
def checkpoints(tmp_path: Path) -> Path:
    path = tmp_path / "checkpoints.json"
    path.write_text(json.dumps({"filtering": {STREAM: 450}, "optimisation": {STREAM: 250}}))
    return path


def _file(data: Path, first: int) -> Path:
    return data / "log" / STREAM / f"{first:012d}.mcap"


def test_sealing_says_which_files_it_sealed_and_does_nothing_again(data: Path) -> None:
    assert len(trigpoint("log", "seal", data, "--json").answer["sealed"]) == 5
    assert trigpoint("log", "seal", data, "--json").answer["sealed"] == []
    assert trigpoint("log", "verify", data, "--json").answer["whole"]


def test_a_stream_being_written_keeps_its_last_file(data: Path) -> None:
    with closing(McapLog(data / "log")) as log:
        log.append(STREAM, imu_rows(480, 490))
        said = trigpoint("log", "seal", data, "--json").answer
    assert (len(said["sealed"]), said["written_streams"]) == (5, [STREAM])


def test_a_log_being_written_is_whole_and_its_open_streams_are_named(data: Path) -> None:
    with closing(McapLog(data / "log")) as log:
        log.append(STREAM, imu_rows(480, 490))
        said = trigpoint("log", "verify", data, "--json")
    assert (said.status, said.answer["written_streams"]) == (0, [STREAM])
    assert trigpoint("log", "verify", data, "--json").answer["written_streams"] == []


def test_a_file_that_its_writer_left_open_is_unfinished(data: Path, tmp_path: Path) -> None:
    with closing(McapLog(data / "log")) as log:
        log.append(STREAM, imu_rows(480, 490))
        left = shutil.copytree(data, tmp_path / "left")
    said = trigpoint("log", "verify", left, "--json")
    assert (said.status, [one["kind"] for one in said.answer["findings"]]) == (2, ["unfinished"])


def test_a_damaged_file_is_not_sealed_and_said_with_status_2(data: Path) -> None:
    content = bytearray(_file(data, 100).read_bytes())
    content[len(content) // 2] ^= 1
    _file(data, 100).write_bytes(content)
    said = trigpoint("log", "seal", data, "--json")
    assert (said.status, len(said.answer["sealed"])) == (2, 4)
    assert str(_file(data, 100)) in said.answer["faults"][0]


def test_a_service_that_writes_seals_its_finished_files_and_ends_old_ones(tmp_path: Path) -> None:
    with closing(McapLog(tmp_path, rotation=ROTATION)) as log:
        _write(log)
        seal_written(log, now_ns=1)
        assert len(list((tmp_path / STREAM).glob("*.sha256"))) == 4
        seal_written(log, now_ns=1001)
        assert len(list((tmp_path / STREAM).glob("*.sha256"))) == 5


def test_only_what_every_reader_has_passed_goes(data: Path, checkpoints: Path) -> None:
    trigpoint("log", "seal", data)
    said = trigpoint("log", "retain", data, "--keep-bytes", 0, "--checkpoints", checkpoints, "--json").answer
    assert [file["first_number"] for file in said["removed"]] == [0, 100]
    assert said["kept_because"] == {STREAM: "optimisation has passed it up to number 250 only"}
    assert not _file(data, 100).exists()


def test_a_dry_run_takes_nothing_away(data: Path, checkpoints: Path) -> None:
    trigpoint("log", "seal", data)
    words = ("log", "retain", data, "--keep-days", 0, "--checkpoints", checkpoints, "--dry-run", "--json")
    assert len(trigpoint(*words).answer["removed"]) == 2
    assert _file(data, 0).exists()


def test_verification_says_what_was_retained_away(data: Path) -> None:
    trigpoint("log", "seal", data)
    trigpoint("log", "retain", data, "--keep-bytes", 0, "--passed", f"all:{STREAM}=150")
    said = trigpoint("log", "verify", data, "--json")
    absence = {"stream": STREAM, "numbers": [0, 100], "reason": "retained away"}
    assert (said.status, said.answer["absences"]) == (0, [absence])


@pytest.mark.parametrize("content", ["rubbish", "[]", '{"a": 1}', '{"a": {"map": -1}}', '{"a": {"map": true}}'])
def test_a_file_that_holds_no_checkpoints_is_refused(data: Path, tmp_path: Path, content: str) -> None:
    path = tmp_path / "bad.json"
    path.write_text(content)
    said = trigpoint("log", "retain", data, "--keep-days", 1, "--checkpoints", path, "--json")
    assert said.status == 2
    assert str(path) in said.answer["error"]


@pytest.mark.parametrize("words", [(), ("--keep-days", 1, "--keep-bytes", 1), ("--keep-days", 1, "--passed", "x")])
def test_retaining_by_unclear_words_is_refused(data: Path, words: tuple[str | int, ...]) -> None:
    assert trigpoint("log", "retain", data, *words, "--json").status == 2


def test_recovery_says_what_is_lost_by_stream_number_and_identity(data: Path, tmp_path: Path) -> None:
    content = bytearray(_file(data, 100).read_bytes())
    content[content.index(b"zstd") + 40] ^= 1
    _file(data, 100).write_bytes(content)
    said = trigpoint("log", "recover", data, tmp_path / "out", "--json")
    (stream,) = said.answer["streams"]
    assert (said.status, said.answer["verified"], said.answer["count"], said.answer["lost"]) == (0, True, 460, 20)
    assert stream["lost_numbers"] == [[100, 120]]
    assert stream["missing"] == [{"source": "van", "boot_id": "boot-1", "sequences": [100, 120]}]
    assert trigpoint("log", "verify", tmp_path / "out", "--json").answer["whole"]


def test_recovery_that_cannot_be_written_ends_with_status_1(data: Path) -> None:
    said = trigpoint("log", "recover", data, "/proc/recovered", "--json")
    assert said.status == 1
    assert "not recovered" in said.answer["error"]


def test_recovery_into_a_directory_that_holds_something_is_refused(data: Path) -> None:
    said = trigpoint("log", "recover", data, data, "--json")
    assert said.status == 2
    assert "holds something already" in said.answer["error"]


def test_what_is_kept_may_be_configured_and_a_flag_goes_before_that(
    data: Path, checkpoints: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = tmp_path / "trigpoint.toml"
    config.write_text("[log]\nkeep_bytes = 1\n", encoding="utf-8")
    trigpoint("log", "seal", data)
    words = ("log", "retain", data, "--config", config, "--checkpoints", checkpoints, "--dry-run", "--json")
    assert len(trigpoint(*words).answer["removed"]) == 2
    assert trigpoint(*words, "--keep-bytes", 10_000_000).answer["removed"] == []
    monkeypatch.setenv("TRIGPOINT_LOG__KEEP_BYTES", "10000000")
    assert trigpoint(*words).answer["removed"] == []


def test_a_configuration_that_keeps_by_age_and_by_size_is_refused(data: Path) -> None:
    said = trigpoint("log", "retain", data, "--set", "log.keep_days=1", "--set", "log.keep_bytes=2", "--json")
    assert said.status == 2
    assert "keep_days 1 and keep_bytes 2" in said.answer["error"]


def test_a_service_s_files_end_as_they_are_configured() -> None:
    configured = LogSettings(file_bytes=65_536, file_span_s=60.0, file_age_s=120.0)
    rotation = rotation_of(configured)
    assert (rotation.size_bytes, rotation.span_ns, rotation.age_ns) == (65_536, 60 * 10**9, 120 * 10**9)
    assert rotation_of(LogSettings()) == Rotation()


def _answers(data: Path) -> Mapping[str, object]:
    answer: Mapping[str, object] = trigpoint("log", "verify", data, "--json").answer
    return answer


def test_a_wrong_catalog_is_found_and_made_anew_by_opening_the_log(data: Path) -> None:
    (data / "log" / "catalog.sqlite").write_bytes(b"rubbish" * 1000)
    assert not _answers(data)["whole"]
    McapLog(data / "log").close()
    assert _answers(data)["whole"]
