"""Each service killed by signal 9 at random moments: what is left in the end is what an uninterrupted run leaves."""

import shutil
from contextlib import closing
from pathlib import Path

from command_runs.processes import Fleet
from command_runs.small_campus import write_small_campus
from fleet_runs.killing import kill_while_catching_up
from fleet_runs.outcome import Outcome, doubled, outcome_of, row_differences, stream_differences
from fleet_runs.running import catch_up, fleet_of
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


def test_filtering_killed_on_the_way_says_everything_once(tmp_path: Path) -> None:
    drives = write_small_campus(tmp_path / "campus").logs
    with closing(McapLog(tmp_path / "data" / "log")) as log:
        ingest_logs(drives, log)
    killed, whole = killed_and_whole(tmp_path, "filtering", tmp_path / "data")
    assert doubled(killed) == []
    assert "filtering" in {stream for stream, _, _ in whole.boots}
    assert stream_differences(killed, whole) == []
