"""`trigpoint serve perception` under `trigpoint up`: killed, it goes on, and each sweep is told of once."""

import os
import signal
from contextlib import closing
from pathlib import Path

from command_runs.processes import Fleet, fleet_in, free_ports, trigpoint_process, wait_until
from scanned_worlds.drives import scanned_drive
from trigpoint.events.perceived import LandmarksPerceived
from trigpoint.logs.mcap_log import McapLog
from trigpoint_perception.app import STREAM

UP = '[up]\nservices = ["router", "perception"]\nbackoff_first_s = 0.05\n'
WAITING = 5  # sweeps of a drive that goes on


def fleet_of(folder: Path) -> Fleet:
    (port,) = free_ports(1)
    fleet = fleet_in(folder, f"perception_port = {port}\n{UP}")
    fleet.ports["perception"] = port
    return fleet


def told(log: McapLog) -> list[int]:
    events = [row.envelope.event for row in log.read(STREAM, kinds=(LandmarksPerceived,))]
    return [event.sweep_sequence for event in events if isinstance(event, LandmarksPerceived)]


def test_killed_while_it_works_it_goes_on_and_tells_of_each_sweep_once(tmp_path: Path) -> None:
    fleet, rows = fleet_of(tmp_path), list(scanned_drive("van", 16))
    sweeps = [row.identity.sequence for row in rows][2::2]
    with (
        closing(McapLog(fleet.data / "log")) as log,
        trigpoint_process(tmp_path, "up", "--config", fleet.config) as up,
    ):
        fleet.wait_ready("perception")
        log.append("veh-van", rows[:17])
        wait_until(lambda: len(told(log)) >= 8 - WAITING, "the first sweeps to be perceived")
        os.kill(fleet.told("up", "/healthz")["processes"]["perception"]["pid"], signal.SIGKILL)
        log.append("veh-van", rows[17:])
        wait_until(lambda: len(told(log)) >= len(sweeps) - WAITING, "the others too")
        status, metrics = fleet.page("perception", "/metrics")
        assert up.stop() == 0
        assert told(log) == sweeps[: len(told(log))]
    assert status == 200
    assert 'trigpoint_accepted_total{vehicle="van"}' in metrics
    assert (fleet.data / "checkpoints" / "perception").exists()
