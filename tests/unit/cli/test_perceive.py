"""`trigpoint perceive` on a log with a few sweeps."""

import json
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scanned_worlds.casting import PERIOD_NS, SIXTEEN, START_NS, STREET, driven_pose, swept
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import VehicleDescribed
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.mcap_log import McapLog
from trigpoint_cli.app import run

VELOCITY = (5.0, 0.1)


def sweep(number: int) -> PointsScanned:
    return swept(STREET, SIXTEEN, pose=driven_pose(VELOCITY, 0.1 * number), velocity=VELOCITY)


def logged(folder: Path, events: list[Event], *, boot_id: str = "boot-1") -> Path:
    with closing(McapLog(folder / "log")) as log:
        log.append(
            "veh-van",
            [
                Envelope(EventIdentity("van", boot_id, number), START_NS + number * PERIOD_NS, event)
                for number, event in enumerate(events)
            ],
        )
    return folder


def test_its_json_says_what_was_found_and_again_nothing_is_appended(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = logged(tmp_path, [sweep(number) for number in range(5)])
    statuses = [run(["perceive", "--data", str(data), "--json"]) for _ in range(2)]
    first, second = map(json.loads, capsys.readouterr().out.splitlines())
    assert statuses == [0, 0]
    assert (first["drives"][0]["sweeps"], first["drives"][0]["poles"], first["drives"][0]["appended"]) == (5, 5, 9)
    assert (first["appended"], second["appended"]) == (10, 0)  # the search for loops too


def test_it_says_which_loops_were_proposed_and_closed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = logged(tmp_path, [sweep(number) for number in range(5)])
    logged(data, [sweep(number) for number in range(5)], boot_id="boot-2")
    assert run(["perceive", "--data", str(data)]) == 0
    assert "van: 1 loop proposed, 1 closed" in capsys.readouterr().out
    run(["perceive", "--data", str(data), "--json"])
    loops = json.loads(capsys.readouterr().out)["loops"]
    assert sorted((each["proposed"], each["verified"], each["refused"]) for each in loops) == [(0, 0, {}), (1, 1, {})]


def test_a_sweep_that_cannot_be_used_ends_it_with_status_2_after_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bad = replace(sweep(2), point_m=np.full((28800, 3), np.nan, dtype=np.float32))
    data = logged(tmp_path, [sweep(0), sweep(1), bad, sweep(3), sweep(4)])
    assert run(["perceive", "--data", str(data)]) == 2
    said = capsys.readouterr()
    assert "1 sweep refused: no usable points" in said.err
    assert "van: 5 sweeps, 3 matched; " in said.out


def test_a_log_without_sweeps_is_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = logged(tmp_path, [VehicleDescribed(vehicle="van")])
    assert run(["perceive", "--data", str(data)]) == 2
    assert "no drive has lidar sweeps" in capsys.readouterr().err
