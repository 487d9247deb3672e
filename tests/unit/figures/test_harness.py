"""The harness of the figures itself, with small programs in the place of `trigpoint`."""

import json
import math
import sys
from pathlib import Path

import pytest

from figures.__main__ import GROUPS, chosen_groups
from figures.figure import Figure, Measurement, at_most, between, json_line, measured_lines
from figures.workbench import CommandFailed, Workbench

ECHO = """
import json, sys
open("calls", "a").write("x")
json.dump({"words": len(sys.argv) - 1, "deep": {"m": 0.5}}, sys.stdout)
"""
FAILING = "import sys; open('calls', 'a').write('x'); sys.exit('latitude 91: at most 90')"


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Workbench:
    monkeypatch.chdir(tmp_path)
    return Workbench(tmp_path, tmp_path / "drives", (sys.executable, "-c", ECHO))


def constant(value: float) -> Figure:
    return Figure(name="f", unit="m", target=at_most(1.0), measure=lambda bench: Measurement(value=value, command="c"))


def run_ingest(bench: Workbench) -> Measurement:
    return Measurement(value=0.0, command=bench.run("ingest").command)


def test_a_number_is_read_by_its_dotted_path(bench: Workbench) -> None:
    assert bench.run("a", "--json").at("deep.m") == 0.5


def test_the_same_words_run_once(bench: Workbench, tmp_path: Path) -> None:
    assert bench.run("a", 1, "--json") is bench.run("a", "1", "--json")
    assert (tmp_path / "calls").read_text() == "x"


def test_a_shown_command_stands_without_the_temporary_folder(bench: Workbench) -> None:
    assert bench.run("build", "--data", bench.path("d")).command == "trigpoint build --data $WORK/d"


@pytest.mark.parametrize("path", ["absent", "deep.absent", "deep", "words.m"])
def test_a_number_that_is_not_there_is_named(bench: Workbench, path: str) -> None:
    with pytest.raises(CommandFailed, match=path):
        bench.run("a", "--json").at(path)


def test_a_failed_command_gives_its_status_and_last_line(bench: Workbench, tmp_path: Path) -> None:
    failing = Workbench(tmp_path, tmp_path, (sys.executable, "-c", FAILING))
    with pytest.raises(CommandFailed, match="trigpoint ingest: exit status 1: latitude 91: at most 90"):
        failing.run("ingest")


def test_a_failed_command_is_not_tried_again(bench: Workbench, tmp_path: Path) -> None:
    failing = Workbench(tmp_path, tmp_path, (sys.executable, "-c", FAILING))
    rows = measured_lines("g", [Figure(name=name, unit="", target=None, measure=run_ingest) for name in "ab"], failing)
    assert [row["holds"] for row in rows] == [False, False]
    assert (tmp_path / "calls").read_text() == "x"


def test_output_that_is_not_json_is_named(tmp_path: Path) -> None:
    wordy = Workbench(tmp_path, tmp_path, (sys.executable, "-c", "pass"))
    with pytest.raises(CommandFailed, match="not JSON"):
        wordy.run("build", "--json")


def test_an_absent_drive_is_named(bench: Workbench) -> None:
    with pytest.raises(CommandFailed, match="'nclt' is not at"):
        bench.drive("nclt")


def test_a_line_has_the_promised_keys_in_order(bench: Workbench) -> None:
    (row,) = measured_lines("g", [constant(0.5)], bench)
    assert list(json.loads(json_line(row))) == ["figure", "value", "unit", "target", "holds", "command"]
    assert (row["figure"], row["value"], row["target"], row["holds"]) == ("g: f", 0.5, "at most 1", True)


def test_a_figure_that_cannot_be_measured_does_not_hold_and_the_next_one_goes_on(bench: Workbench) -> None:
    absent = Figure(
        name="a", unit="", target=None, measure=lambda bench: Measurement(value=0.0, command=bench.drive("x"))
    )
    rows = list(measured_lines("g", [absent, constant(0.5)], bench))
    assert [(row["value"], row["holds"]) for row in rows] == [(None, False), (0.5, True)]


@pytest.mark.parametrize(
    ("value", "holds"), [(0.69, False), (0.7, True), (1.4, True), (1.41, False), (math.nan, False)]
)
def test_a_target_includes_its_ends_and_never_nan(value: float, holds: bool) -> None:
    assert between(0.7, 1.4).hold(value) is holds


def test_groups_are_chosen_by_name_and_an_unknown_one_is_refused() -> None:
    assert chosen_groups("demo,nclt") == ["demo", "nclt"]
    assert chosen_groups(None) == list(GROUPS)
    with pytest.raises(ValueError, match="no figures are called moon"):
        chosen_groups("moon")


def test_no_two_figures_of_a_group_share_a_name() -> None:
    names = [(group, figure.name) for group, figures in GROUPS.items() for figure in figures]
    assert len(names) == len(set(names))
