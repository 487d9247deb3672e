"""Each service killed by signal 9 at random moments: what is left in the end is what an uninterrupted run leaves."""

import shutil
import signal
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from command_runs.processes import Fleet, children_of, runs, wait_until
from command_runs.small_campus import write_small_campus
from fleet_runs.commands import by_commands
from fleet_runs.driven import drive, small_campus
from fleet_runs.driving import first_part
from fleet_runs.killing import Killing, kill_while_catching_up
from fleet_runs.outcome import (
    Outcome,
    correction_differences,
    doubled,
    final_differences,
    newest_map,
    outcome_of,
    replayed_differences,
    row_differences_of_newest_maps,
    stream_differences,
)
from fleet_runs.running import FOLLOWERS, alone, catch_up, fleet_of, settle
from landmark_maps.examples import append_mapped, pin_frame, solved_landmark, solved_map
from trigpoint.logs.mcap_log import McapLog
from trigpoint_ingest.recorded import ingest_logs

KILLS = 2
SMALL_STEPS = "[landmarks]\nbatch_events = 200\n"  # three map versions a transaction
VERSIONS, LANDMARKS = 120, 60


def killed_and_whole(tmp_path: Path, name: str, data: Path) -> tuple[Outcome, Outcome]:
    """What a service makes of a log when it is killed on the way, and when it is not."""
    killed, whole = (fleet_with(tmp_path / kind, name, data) for kind in ("killed", "whole"))
    kill_while_catching_up(killed, name, times=KILLS)
    catch_up(killed, name)
    catch_up(whole, name)
    return outcome_of(killed), outcome_of(whole)


def fleet_with(folder: Path, name: str, data: Path) -> Fleet:
    """A fleet with a copy of a data directory."""
    fleet = fleet_of(folder, (name,), toml=SMALL_STEPS)
    shutil.copytree(data, fleet.data)
    return fleet


def test_a_projection_killed_on_the_way_leaves_the_database_of_one_that_was_not(tmp_path: Path) -> None:
    with closing(McapLog(tmp_path / "data" / "log")) as log:
        pin_frame(log)
        for number in range(1, VERSIONS + 1):
            moved = [solved_landmark(f"L{n}", n + 0.01 * number, 0.1, map_version=number) for n in range(LANDMARKS)]
            append_mapped(log, solved_map(number, moved), boot_id=f"boot-{number}")
    killed, whole = killed_and_whole(tmp_path, "landmarks", tmp_path / "data")
    assert len(whole.rows) > VERSIONS * LANDMARKS
    assert replayed_differences(killed) == []
    assert row_differences_of_newest_maps(killed, whole) == []


@pytest.fixture(scope="module")
def ingested(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data directory with a drive through a small campus, and nothing made of it yet."""
    folder = tmp_path_factory.mktemp("ingested")
    drives = write_small_campus(folder / "campus").logs
    with closing(McapLog(folder / "data" / "log")) as log:
        ingest_logs(drives[:1], log)
    return folder / "data"


def test_filtering_killed_on_the_way_says_everything_once(tmp_path: Path, ingested: Path) -> None:
    killed, whole = killed_and_whole(tmp_path, "filtering", ingested)
    assert doubled(killed) == []
    assert "filtering" in {stream for stream, _, _ in whole.boots}
    assert stream_differences(killed, whole) == []


def driven_and_killed(tmp_path: Path, killing: Killing, *, duration_s: float, speed: float) -> Fleet:
    """A fleet that has taken in the first part of two drives, whose services were killed on the way."""
    campus = small_campus(tmp_path / "campus", speed=speed)
    campus = replace(campus, drives=[first_part(rows, duration_s) for rows in campus.drives])
    fleet = fleet_of(tmp_path / "killed")
    drive(fleet, campus, killing=killing)
    settle(fleet)
    return fleet


def test_a_fleet_whose_services_are_killed_ends_with_what_the_commands_make_of_its_log(tmp_path: Path) -> None:
    killing = Killing(services=FOLLOWERS, times_each=1, within_s=8.0)
    fleet = driven_and_killed(tmp_path, killing, duration_s=60.0, speed=4.0)
    killed, whole = outcome_of(fleet), by_commands(fleet.data, tmp_path / "whole")
    assert len(newest_map(whole.rows)) > 20
    assert final_differences(killed, whole) == []


@pytest.mark.slow
def test_a_fleet_whose_services_are_killed_again_and_again_ends_as_one_left_in_peace(tmp_path: Path) -> None:
    campus = small_campus(tmp_path / "campus", speed=4.0)
    fleets = fleet_of(tmp_path / "killed"), fleet_of(tmp_path / "whole")
    rounds = drive(fleets[0], campus, killing=Killing(services=FOLLOWERS, times_each=5, within_s=45.0))
    drive(fleets[1], campus, rounds=rounds)
    for fleet in fleets:
        settle(fleet)
    killed, whole = map(outcome_of, fleets)
    assert final_differences(killed, whole) == []
    assert correction_differences(killed, whole) == []


def test_a_whole_solve_ends_with_the_service_that_was_killed(tmp_path: Path, ingested: Path) -> None:
    fleet = fleet_with(tmp_path / "fleet", "optimisation", ingested)
    with alone(fleet, "optimisation") as process:
        wait_until(lambda: bool(children_of(process.popen.pid)), "a whole solve")
        solving = children_of(process.popen.pid)
        process.send(signal.SIGKILL)
        process.ended()
        wait_until(lambda: not any(map(runs, solving)), f"{solving} ended", within_s=5.0)
