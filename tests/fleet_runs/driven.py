"""A fleet driven from the first message to the last acknowledgement, its services killed on the way or not."""

from collections.abc import Sequence

from command_runs.processes import Fleet, trigpoint_process
from fleet_runs.driving import Rows, vehicles_on_the_road
from fleet_runs.killing import Killing, kill_all


def drive(fleet: Fleet, drives: Sequence[Rows], *, speed: float, killing: Killing | None = None) -> Sequence[str]:
    """Who was killed while the drives were replayed into the running fleet; every event is acknowledged then."""
    killed: Sequence[str] = ()
    with trigpoint_process(fleet.folder, "up", "--config", fleet.config) as up:
        fleet.wait_ready("ingest")
        with vehicles_on_the_road([iter([rows]) for rows in drives], fleet.endpoint, speed=speed) as vehicles:
            if killing is not None:
                killed = kill_all(fleet, killing)
            for vehicle in vehicles:
                vehicle.join()
        assert up.stop() == 0, up.err
    return killed
