"""Each service killed by signal 9 at random moments: what is left in the end is what an uninterrupted run leaves."""

import shutil
from contextlib import closing
from pathlib import Path

import pytest

from command_runs.processes import Fleet
from command_runs.small_campus import write_small_campus
from fleet_runs.driven import drive
from fleet_runs.driving import small_campus_drives
from fleet_runs.killing import Killing, kill_while_catching_up
from fleet_runs.outcome import (
    Outcome,
    doubled,
    map_differences,
    newest_map,
    outcome_of,
    row_differences,
    stream_differences,
)
from fleet_runs.running import FOLLOWERS, catch_up, fleet_of, settle
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
    assert row_differences(killed, whole) == []


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


@pytest.mark.slow
def test_a_fleet_whose_services_are_killed_ends_with_the_map_of_one_left_in_peace(tmp_path: Path) -> None:
    drives = small_campus_drives(tmp_path / "campus")
    killing = Killing(services=FOLLOWERS, times_each=2)
    outcomes = []
    for name, plan in (("killed", killing), ("whole", None)):
        fleet = fleet_of(tmp_path / name)
        drive(fleet, drives, speed=8.0, killing=plan)
        settle(fleet)
        outcomes.append(outcome_of(fleet))
    assert doubled(outcomes[0]) == []
    assert stream_differences(*outcomes, streams=("filtering",)) == []
    assert len(newest_map(outcomes[1].rows)) > 50
    assert map_differences(*outcomes) == []
