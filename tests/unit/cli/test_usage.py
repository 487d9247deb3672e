import os
import subprocess
import sys
from pathlib import Path

import pytest

from command_runs.running import trigpoint

NOTHING = "no-such-directory"


@pytest.mark.parametrize(
    "words",
    [
        ("build", "--data", NOTHING),
        ("evaluate", "gnss", "--data", NOTHING, "--withhold-period-s", "60", "--withhold-duration-s", "30"),
        ("evaluate", "leave-out", "--data", NOTHING, "--tied", "3"),
        ("landmarks", "--data", NOTHING),
        ("replay", "--data", NOTHING),
        ("report", "--data", NOTHING),
        ("log", "info", NOTHING),
        ("log", "verify", NOTHING),
        ("ingest", "missing.mcap", "--data", NOTHING),
        ("anchors", "import", "missing.geojson", "--data", NOTHING),
        ("anchors", "list", "--data", NOTHING),
        ("anchors", "retract", "a", "--data", NOTHING),
        ("drives", "list", "--data", NOTHING),
        ("drives", "exclude", "van", "--data", NOTHING),
        ("drives", "include", "van", "--data", NOTHING),
        ("explain", "lm-1", "--data", NOTHING),
        ("convert", "victoria-park", NOTHING, NOTHING),
        ("convert", "mrclam", NOTHING, NOTHING),
        ("convert", "table", "missing.toml", NOTHING),
        ("convert", "kitti", NOTHING, NOTHING),
        ("convert", "rosbag", "missing.bag", NOTHING),
    ],
    ids=" ".join,
)
def test_what_is_not_there_is_named_in_one_line_and_ends_with_status_2(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    said = trigpoint(*words, "--json")
    assert said.status == said.answer["exit_status"] == 2
    assert said.err.count("\n") == 1
    assert said.answer["error"] in said.err
    assert "missing." in said.err or NOTHING in said.err


def test_the_data_directory_may_come_from_the_environment_and_a_flag_goes_before_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("TRIGPOINT_FLEET__DATA", "from-the-environment")
    assert "from-the-environment: no such data directory" in trigpoint("drives", "list").err
    assert f"{NOTHING}: no such data directory" in trigpoint("drives", "list", "--data", NOTHING).err


def test_nothing_is_made_for_a_command_that_only_reads(tmp_path: Path) -> None:
    trigpoint("build", "--data", tmp_path / NOTHING)
    trigpoint("landmarks", "--data", tmp_path / NOTHING)
    assert list(tmp_path.iterdir()) == []


def test_an_empty_directory_is_no_data_directory(tmp_path: Path) -> None:
    said = trigpoint("build", "--data", tmp_path, "--json")
    assert said.status == 2
    assert "no log in there" in said.answer["error"]


@pytest.mark.parametrize(
    "words",
    [
        ("sail",),
        ("build",),
        ("build", "--data", ".", "--method", "magic"),
        ("evaluate", "gnss", "--data", "."),
        ("demo", "--seed", "many"),
        ("convert", "rosbag", "a.bag", "out", "--lidar", "velodyne=1,2"),
    ],
    ids=" ".join,
)
def test_bad_usage_ends_with_status_2_and_says_why(words: tuple[str, ...]) -> None:
    said = trigpoint(*words, "--json")
    assert (said.status, said.answer["exit_status"]) == (2, 2)
    assert words[-1] in said.err or "Missing option" in said.err


@pytest.mark.parametrize("group", ["certs", "config", "drives", "log", "vehicle"])
def test_a_group_without_a_command_lists_its_commands_line_by_line(group: str) -> None:
    said = trigpoint(group)
    assert said.status == 2
    assert "\nCommands:\n" in said.err


def test_a_replay_that_would_give_up_at_once_is_refused_with_the_limit() -> None:
    words = ("vehicle", "replay", "a.mcap", "--connect", "tcp/127.0.0.1:1", "--give-up-after-s", "-5", "--json")
    said = trigpoint(*words)
    assert said.status == 2
    assert "-5" in said.answer["error"]


@pytest.mark.parametrize(("option", "value"), [("--seed", "-1"), ("--vehicles", "0"), ("--vehicles", "51")])
def test_a_campus_that_cannot_be_is_refused_with_the_limits(option: str, value: str, tmp_path: Path) -> None:
    said = trigpoint("demo", "--out", tmp_path / "demo", option, value, "--json")
    assert said.status == 2
    assert value in said.answer["error"]
    assert not (tmp_path / "demo").exists()


def test_a_demonstration_does_not_empty_somebody_else_s_directory(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    said = trigpoint("demo", "--out", tmp_path, "--json")
    assert said.status == 2
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


def test_a_demonstration_is_not_mixed_with_an_earlier_one_that_cannot_be_emptied(tmp_path: Path) -> None:
    out, elsewhere = tmp_path / "demo", tmp_path / "elsewhere"
    out.mkdir()
    elsewhere.mkdir()
    (out / "trigpoint-demo").touch()
    (out / "log").symlink_to(elsewhere)  # what is behind a link is not removed
    said = trigpoint("demo", "--out", out, "--json")
    assert said.status == 2
    assert f"{out}: cannot be written" in said.answer["error"]


def test_an_error_nobody_reads_the_json_of_is_still_one_line_and_its_status() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    program = "from trigpoint_cli.app import main; main()"
    command = (sys.executable, "-c", program, "build", "--data", NOTHING, "--json")
    ended = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (ended.returncode, ended.stderr.count("\n")) == (2, 1)


def test_near_without_a_radius_is_refused(tmp_path: Path) -> None:
    said = trigpoint("landmarks", "--data", tmp_path, "--near", "0,0", "--json")
    assert said.status == 2
    assert "--radius-m" in said.answer["error"]


def test_without_debug_no_traceback_is_shown(tmp_path: Path) -> None:
    assert "Traceback" not in trigpoint("build", "--data", tmp_path).err


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("--nearest", "3"), "go with --near"),
        (("--near", "0,0", "--nearest", "3", "--radius-m", "5"), "one of the two is needed"),
        (("--near", "0,0", "--nearest", "0"), "nearest 0 is outside 1 to 10000"),
        (("--seen", "yesterday"), "is not FIRST_NS,LAST_NS"),
        (("--max-sigma-m", "-1"), "max_sigma_m -1.0 is outside"),
    ],
)
def test_conditions_that_say_nothing_are_refused_with_what_is_needed(
    words: tuple[str, ...], reason: str, tmp_path: Path
) -> None:
    said = trigpoint("landmarks", "--data", tmp_path, *words, "--json")
    assert said.status == 2
    assert reason in said.answer["error"]
