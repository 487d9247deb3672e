"""Ingest killed by signal 9 at random moments while vehicles publish, and started again each time."""

import json
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from command_runs.processes import CLEAN, Fleet, fleet_in, trigpoint_process
from ingest_load.kept import Kept, kept_of

FLUSHED_WITHIN_S = 150.0
WAIT_MAX_S = 1.0  # from being ready to being killed


@dataclass(frozen=True, slots=True, kw_only=True)
class Survived:
    """What was left after so many kills; `acknowledged`: every vehicle heard that all its messages are kept."""

    kills: int
    acknowledged: bool
    kept: Kept


def killed_under_load(folder: Path, *, kills: int, vehicles: int = 10, seed: int = 1) -> Survived:
    """What is in the log after ingest was killed so many times while vehicles published all along."""
    fleet = fleet_in(folder)
    die, pause = Random(seed), threading.Event()
    with trigpoint_process(folder, "router", "--config", fleet.config):
        fleet.wait_ready("router")
        with publishing(fleet, vehicles=vehicles) as publishers:
            for _ in range(kills):
                with serving(fleet) as ingest:
                    pause.wait(die.uniform(0.0, WAIT_MAX_S))
                    ingest.send(signal.SIGKILL)
                    ingest.ended()
            with serving(fleet) as ingest:
                answer = told(publishers)
                ingest.stop()
    sent = {vehicle: (one["boot_id"], one["sent"]) for vehicle, one in answer.items()}
    acknowledged = all(one["all_acknowledged"] for one in answer.values())
    return Survived(kills=kills, acknowledged=acknowledged, kept=kept_of(fleet.data / "log", sent))


@contextmanager
def serving(fleet: Fleet) -> Iterator[Any]:
    """Ingest as a process, at work."""
    with trigpoint_process(fleet.folder, "serve", "ingest", "--config", fleet.config) as process:
        fleet.wait_ready("ingest")
        yield process


@contextmanager
def publishing(fleet: Fleet, *, vehicles: int) -> Iterator["subprocess.Popen[bytes]"]:
    """Vehicles that publish, in a process of their own; killed at the end if it still runs."""
    command = [sys.executable, "-m", "ingest_load.publishers", fleet.endpoint, str(fleet.folder / "spools")]
    popen = subprocess.Popen(
        [*command, "--vehicles", str(vehicles)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=CLEAN | {"PYTHONPATH": str(Path(__file__).parents[1])},
    )
    try:
        yield popen
    finally:
        popen.kill()
        popen.communicate()


def told(publishers: "subprocess.Popen[bytes]") -> dict[str, Any]:
    """What the vehicles say once they have flushed everything."""
    out, _ = publishers.communicate(timeout=FLUSHED_WITHIN_S)
    answer: dict[str, Any] = json.loads(out)
    return answer
