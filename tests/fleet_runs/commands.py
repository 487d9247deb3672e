"""What the commands make, one after the other and in one process, of what came into a fleet's log."""

from contextlib import closing
from pathlib import Path

from fleet_runs.outcome import DATABASE, Outcome, outcome_in
from trigpoint.landmarks.opening import geopackage_url, opened_store
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.readings import FRAME_STREAM, LABEL_STREAM, vehicle_streams
from trigpoint_filtering.app import filter_log
from trigpoint_landmarks.app import project
from trigpoint_optimisation.app import build
from trigpoint_optimisation.settings import SolveSettings


def by_commands(held: Path, data: Path) -> Outcome:
    """The outcome, in a new data directory, of the vehicles' events, the frame and the labels of another one."""
    copy_inputs(held, data)
    with closing(McapLog(data / "log")) as log:
        filter_log(log)
        build(log, SolveSettings())
        with closing(opened_store(geopackage_url(data / DATABASE))) as store:
            project(log, store)
    return outcome_in(data)


def copy_inputs(held: Path, data: Path) -> None:
    """What came from outside, and nothing that was made of it."""
    with closing(McapLog(held / "log")) as log, closing(McapLog(data / "log")) as copy:
        for stream in (*vehicle_streams(log), FRAME_STREAM, LABEL_STREAM):
            copy.append(stream, [row.envelope for row in log.read(stream)])
