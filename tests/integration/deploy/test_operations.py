"""The runbook, against the command, the configuration and the metrics; and its disaster drill, done."""

import os
import re
import shlex
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import click
import pytest

from command_runs.processes import CLEAN
from command_runs.running import trigpoint as run_command
from landmark_databases.cluster import Cluster
from landmark_maps.examples import append_labels, append_mapped, label, pin_frame, solved_landmark, solved_map
from trigpoint.bus.register import Role
from trigpoint.configuration.sections import HttpSettings
from trigpoint.configuration.tree import table_of
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import ImuMeasured, Observed, VehicleDescribed
from trigpoint.logs.mcap_log import McapLog
from trigpoint.observability.metrics import Instruments
from trigpoint_cli.app import trigpoint
from trigpoint_cli.settings import Settings

REPOSITORY = Path(__file__).parents[3]
TEXT = (REPOSITORY / "docs" / "operations.md").read_text(encoding="utf-8")
KEYS = {f"[{path[0]}] {'.'.join(path[1:])}" for path in table_of(Settings).value_types()}
STAMP_NS = 1_700_000_000_000_000_000
VEHICLE, EVENTS = "veh-a", 20_000


def blocks(kind: str) -> list[str]:
    """The lines of all fenced blocks of a kind."""
    found = re.findall(rf"^```{kind}\n(.*?)^```$", TEXT, flags=re.MULTILINE | re.DOTALL)
    return [line for block in found for line in block.splitlines()]


def commands() -> list[str]:
    """Every `trigpoint …` on the page, with its words, in blocks and in running text."""
    written = [line for line in blocks("sh") + blocks("sh drill") if line.startswith("trigpoint ")]
    inline = [found for found in re.findall(r"`(trigpoint [a-z][^`]*)`", TEXT) if "…" not in found]
    return [line.partition(" #")[0] for line in written + inline]


@pytest.mark.parametrize("line", commands())
def test_a_command_of_the_runbook_is_one_with_options_that_there_are(line: str) -> None:
    words = shlex.split(line)[1:]
    context, found = click.Context(trigpoint), trigpoint
    while isinstance(found, click.Group) and words:
        chosen = found.get_command(context, words[0])
        assert chosen is not None, f"{line}: no command {words[0]}"
        context, found, words = click.Context(chosen, parent=context), chosen, words[1:]  # type: ignore[assignment]
    options = {name for parameter in found.params for name in (*parameter.opts, *parameter.secondary_opts)}
    assert [word for word in words if word.startswith("--") and word not in options] == []


def test_ports_on_the_page_are_the_defaults() -> None:
    told = dict(re.findall(r"^\| (?:all of one machine|(\w+)) \| `trigpoint [\w ]+` \| (\d+) \|", TEXT, re.MULTILINE))
    expected = {("" if name == "up" else name): str(port) for name, port in HttpSettings().ports().items()}
    assert told == expected


def test_every_metric_is_explained_and_none_that_there_is_not() -> None:
    named = set(re.findall(r"^# HELP (\w+) ", Instruments("any").exposition().decode(), flags=re.MULTILINE))
    told = set(re.findall(r"^\| `(trigpoint_\w+)` \|", TEXT, flags=re.MULTILINE))
    assert told == {name for name in named if not name.endswith("_created")}


def test_every_key_on_the_page_is_one_of_the_configuration() -> None:
    told = {f"[{section}] {key}" for section, key in re.findall(r"`\[(\w+)\] (\w+)", TEXT)}
    assert {key for key in told if key not in KEYS} == set()


def test_every_role_is_told_of_and_none_that_there_is_not() -> None:
    rows = re.findall(r"^\| ((?:`\w+`(?:, )?)+) \| .* \| .* \|$", TEXT.partition("| role |")[2], flags=re.MULTILINE)
    told = {name for row in rows[:6] for name in re.findall(r"`(\w+)`", row)}
    assert told == {role.value for role in Role}


def test_files_the_page_names_are_there() -> None:
    named = set(re.findall(r"deploy/[\w./-]+\w", TEXT))
    made = {"deploy/database_password", "deploy/authority/issued"}  # by the commands on the page
    assert [name for name in sorted(named - made) if not (REPOSITORY / name).exists()] == []


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A small log: a drive of three minutes and two map versions, and the database made of it."""
    data = tmp_path / "data"
    with closing(McapLog(data / "log")) as log:
        append_drive(log)
        pin_frame(log)
        append_labels(log, [label("anchor-1")])
        append_mapped(log, solved_map(1, [solved_landmark("L1", 0.0, 0.0), solved_landmark("L2", 9.0, 0.1)], labels=1))
        moved = [solved_landmark(f"L{n}", 9.0 * n, 0.0, map_version=2) for n in (1, 2, 3)]
        append_mapped(log, solved_map(2, moved, labels=1))
    return data


def append_drive(log: McapLog) -> None:
    events: list[Observed] = [VehicleDescribed(vehicle=VEHICLE, wheelbase_m=2.8)]
    for index in range(1, EVENTS):
        turned = ImuMeasured(yaw_rate_radps=1e-5 * index, acceleration_x_mps2=0.1, acceleration_y_mps2=0.0)
        events.append(turned)
    rows = [
        Envelope(EventIdentity(VEHICLE, "boot-1", sequence), STAMP_NS + sequence * 10_000_000, event)
        for sequence, event in enumerate(events)
    ]
    log.append(f"veh-{VEHICLE}", rows)


def shell(line: str, data: Path) -> "subprocess.CompletedProcess[str]":
    """What comes of a line of the drill."""
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    environment = {**CLEAN, "PATH": path, "DATA": str(data), "VEHICLE": VEHICLE}
    return subprocess.run(["sh", "-c", line], env=environment, capture_output=True, text=True, check=False)


def without_duration(answer: dict[str, object]) -> dict[str, object]:
    return {key: value for key, value in answer.items() if key != "wall_s"}


def expected_status(line: str) -> int:
    told = re.search(r"# exit status (\d)$", line)
    return int(told[1]) if told else 0


def test_the_disaster_drill_ends_as_the_runbook_says(data: Path) -> None:
    landmarks = ("landmarks", "--data", data, "--json")
    assert run_command("replay", "--data", data, "--restore").status == 0
    before = run_command(*landmarks).answer
    lines = blocks("sh drill")
    outcomes = [(line, shell(line, data)) for line in lines]
    assert [
        (line, one.returncode, one.stderr) for line, one in outcomes if one.returncode != expected_status(line)
    ] == []
    assert without_duration(run_command(*landmarks).answer) == without_duration(before)
    with closing(McapLog(data / "log")) as log:
        left = [row.envelope.identity.sequence for row in log.read(f"veh-{VEHICLE}")]
    assert 0 < len(left) < EVENTS
    assert left == list(range(len(left)))  # a whole beginning: nothing in the middle is missing


@pytest.mark.postgis
def test_a_database_of_a_server_that_was_dropped_comes_back_from_the_log(data: Path, postgis: Cluster) -> None:
    name = postgis.created()
    chosen = ("--data", data, "--database", postgis.url(name), "--password-file", postgis.password_file)
    first = run_command("replay", *chosen, "--restore", "--json")
    before = run_command("landmarks", *chosen, "--json").answer
    with postgis.connected("postgres") as connection:
        connection.execute(f"DROP DATABASE {name} WITH (FORCE)")
        connection.execute(f"CREATE DATABASE {name} TEMPLATE with_postgis")
    again = run_command("replay", *chosen, "--restore", "--json")
    assert [one.answer["restored_versions"] for one in (first, again)] == [[1, 2], [1, 2]]
    assert [one.answer["differences"] for one in (first, again)] == [0, 0]
    assert without_duration(run_command("landmarks", *chosen, "--json").answer) == without_duration(before)


def test_restoring_a_database_that_lacks_nothing_changes_nothing(data: Path) -> None:
    assert run_command("replay", "--data", data, "--restore", "--json").answer["restored_versions"] == [1, 2]
    again = run_command("replay", "--data", data, "--restore", "--json").answer
    assert (again["restored_versions"], again["differences"]) == ([], 0)


def test_without_restoring_a_database_that_is_gone_stays_so(data: Path) -> None:
    assert run_command("replay", "--data", data).status == 2
    assert not (data / "landmarks.gpkg").exists()
