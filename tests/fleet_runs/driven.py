"""A fleet driven from the first message to the last acknowledgement, its services killed on the way or not."""

import threading
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from command_runs.processes import Fleet, trigpoint_process, wait_until
from command_runs.small_campus import write_small_campus
from fleet_runs.driving import Rows, again_until, read_rows, vehicles_on_the_road
from fleet_runs.killing import Killing, kill_all
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.readings import pinned_frame
from trigpoint_ingest.anchor_files import read_anchor_file
from trigpoint_ingest.anchors import import_anchors


@dataclass(frozen=True, slots=True, kw_only=True)
class Driven:
    """What a fleet goes through: drives, so many times faster than they were driven, and labels given meanwhile."""

    drives: Sequence[Rows]
    anchors: Path
    speed: float = 1.0


def small_campus(folder: Path, *, speed: float = 1.0) -> Driven:
    """The drives through a campus of a few streets, and its anchors."""
    written = write_small_campus(folder)
    assert written.anchors is not None, "a campus has labels"
    return Driven(drives=[read_rows(path) for path in written.logs], anchors=written.anchors, speed=speed)


def drive(fleet: Fleet, driven: Driven, *, killing: Killing | None = None, rounds: Sequence[int] = ()) -> Sequence[int]:
    """How often each vehicle drove its drive through the running fleet, every event acknowledged: until all kills were
    done on the way, or as often as `rounds` says."""
    done = threading.Event()

    def enough(number: int) -> Callable[[int], bool]:
        return lambda times: times >= rounds[number] if rounds else done.is_set()

    drives = [again_until(rows, enough(number)) for number, rows in enumerate(driven.drives)]
    with trigpoint_process(fleet.folder, "up", "--config", fleet.config) as up:
        fleet.wait_ready("up")
        with vehicles_on_the_road(drives, fleet.endpoint, speed=driven.speed) as vehicles:
            label(fleet, driven.anchors)
            if killing is not None:
                kill_all(fleet, killing)
            done.set()
            for vehicle in vehicles:
                vehicle.join()
        assert up.stop() == 0, up.err
    return [vehicle.rounds for vehicle in vehicles]


def label(fleet: Fleet, anchors: Path) -> None:
    """The anchors labelled, once the vehicles have said where they are."""
    with closing(McapLog(fleet.data / "log")) as log:
        wait_until(lambda: pinned_frame(log) is not None, "a frame")
        report = import_anchors(read_anchor_file(anchors), log)
    assert (report.added > 0, report.refused) == (True, ()), report
