import errno
import json
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
import pytest

from command_runs.running import trigpoint
from trigpoint.errors import AppendFailed, InputError, ServiceError
from trigpoint_cli import app
from trigpoint_cli.output import Answer, CommandIncomplete, Screen, answering, metres, plain


@dataclass(frozen=True, slots=True)
class Pair:
    first: float
    second: "np.ndarray[tuple[int, ...], np.dtype[np.float64]]"


def test_dataclasses_arrays_and_paths_become_what_json_can_hold() -> None:
    found = plain({"pair": Pair(1.5, np.array([1.0, np.nan])), "path": Path("a") / "b", "count": np.int64(3)})
    assert json.loads(json.dumps(found)) == {
        "pair": {"first": 1.5, "second": [1.0, None]},
        "path": "a/b",
        "count": 3,
    }


def test_what_is_not_finite_is_null() -> None:
    assert plain([float("nan"), float("inf"), 0.0]) == [None, None, 0.0]


def test_lengths_are_read_by_people() -> None:
    assert [metres(value) for value in (0.1234, 4039.2, float("nan"))] == ["0.123 m", "4039 m", "unknown"]


def test_an_answer_comes_with_its_duration(capsys: pytest.CaptureFixture[str]) -> None:
    @click.command("ask")
    @answering
    def ask(*, screen: Screen) -> Answer:
        return Answer({"count": 2}, ("two",))

    ask.main(["--json"], standalone_mode=False)
    said = json.loads(capsys.readouterr().out)
    assert said["count"] == 2
    assert said["wall_s"] >= 0.0


def test_what_was_refused_on_the_way_ends_the_command_after_its_answer() -> None:
    @click.command("ask")
    @answering
    def ask(*, screen: Screen) -> Answer:
        return Answer({"count": 2}, (), ("one was refused",))

    with pytest.raises(CommandIncomplete, match="one was refused") as ended:
        ask.main(["--json"], standalone_mode=False)
    assert ended.value.answer["count"] == 2


@pytest.mark.parametrize(
    ("error", "status"),
    [(InputError("x"), 2), (click.UsageError("x"), 2), (ServiceError("x"), 1), (RuntimeError("x"), 1)],
)
def test_the_exit_status_says_whose_turn_it_is(error: Exception, status: int) -> None:
    assert app._status_of(error) == status


def test_a_full_disk_is_for_the_user_to_mend() -> None:
    error = AppendFailed("stream: not written")
    error.__cause__ = OSError(errno.ENOSPC, "No space left on device")
    assert app._status_of(error) == 2


def test_an_unexpected_error_is_one_line_that_says_how_to_find_it() -> None:
    line = app._line_of(KeyError("two\nlines"))
    assert "\n" not in line
    assert "unexpected KeyError" in line
    assert "--debug" in line


def test_help_names_every_command() -> None:
    said = trigpoint("--help").out
    names = ("demo", "convert", "ingest", "build", "anchors", "evaluate", "landmarks", "log", "replay", "report")
    assert [name for name in names if f"  {name} " not in said] == []
