"""Ingest and the bare subscriber, each given the same traffic by the same vehicles, one after the other."""

import json
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from command_runs.processes import CLEAN, SOON_S, Fleet, free_ports, trigpoint_process, wait_until
from trigpoint.logs.mcap_log import McapLog

VEHICLES = 10
LONGEST_S = 180.0
ENVIRONMENT = CLEAN | {"PYTHONPATH": str(Path(__file__).parents[1])}


@dataclass(frozen=True, slots=True, kw_only=True)
class Race:
    """Messages a second of both, from the first sent to the last written or acknowledged."""

    ingest_per_s: float
    bare_per_s: float

    @property
    def ratio(self) -> float:
        """Ingest's rate over the bare subscriber's."""
        return self.ingest_per_s / self.bare_per_s


def raced(folder: Path, *, messages: int, size_bytes: int) -> Race:
    """Both rates for so many messages of each vehicle. What ingest kept is counted: fails if anything is missing."""
    folder.mkdir(parents=True)
    bare = bare_rate(folder, messages=messages, size_bytes=size_bytes)
    with ingest_at_work(folder) as fleet:
        answer = vehicles(fleet.endpoint, "--messages", messages, "--bytes", size_bytes)
    kept = kept_count(fleet.data / "log")
    if kept != VEHICLES * messages:
        raise AssertionError(f"{kept} events in the log, {VEHICLES * messages} were sent")
    return Race(ingest_per_s=answer["messages_per_s"], bare_per_s=bare)


@dataclass(frozen=True, slots=True, kw_only=True)
class Waited:
    """Seconds from when a message was due to its acknowledgement, half of them and all but a hundredth; and how late
    the vehicles handed over, which is part of it."""

    p50_s: float
    p99_s: float
    late_p99_s: float


def waited(folder: Path, *, messages: int, size_bytes: int, rate_hz: float) -> Waited:
    """How long each vehicle's messages waited, at so many a second of all vehicles."""
    folder.mkdir(parents=True)
    with ingest_at_work(folder) as fleet:
        answer = vehicles(fleet.endpoint, "--messages", messages, "--bytes", size_bytes, "--rate", rate_hz)
    return Waited(p50_s=answer["latency_p50_s"], p99_s=answer["latency_p99_s"], late_p99_s=answer["late_p99_s"])


def bare_rate(folder: Path, *, messages: int, size_bytes: int) -> float:
    """Messages a second of the bare subscriber."""
    endpoint = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    count = VEHICLES * messages
    command = [sys.executable, "-m", "ingest_load.bare", endpoint, str(folder / "bare.mcap"), str(count)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=ENVIRONMENT) as bare:
        try:
            vehicles(endpoint, "--messages", messages, "--bytes", size_bytes, "--unacknowledged")
            out, _ = bare.communicate(timeout=LONGEST_S)
        finally:
            bare.kill()
    return float(json.loads(out)["messages_per_s"])


def vehicles(endpoint: str, *words: str | float) -> dict[str, Any]:
    """What the vehicles say after sending everything."""
    command = [sys.executable, "-m", "ingest_load.vehicles", endpoint, *map(str, words)]
    done = subprocess.run(command, stdout=subprocess.PIPE, env=ENVIRONMENT, timeout=LONGEST_S, check=True)
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


@contextmanager
def ingest_at_work(folder: Path, *, data: Path | None = None, toml: str = "") -> Iterator[Fleet]:
    """`trigpoint serve ingest`, its bus open for the vehicles; stopped in order at the end."""
    numbers = free_ports(2)
    ports = {"ingest": numbers[0]}
    fleet = Fleet(folder=data or folder, ports=ports, endpoint=f"tcp/127.0.0.1:{numbers[1]}")
    lines = (
        f'[fleet]\ndata = "{fleet.data}"\n[bus]\nmode = "peer"\nlisten = ["{fleet.endpoint}"]\n'
        f"[http]\ningest_port = {numbers[0]}\n"
    )
    config = folder / f"ingest-{numbers[0]}.toml"
    config.write_text(lines + toml, encoding="utf-8")
    with trigpoint_process(folder, "serve", "ingest", "--config", config) as process:
        wait_until(lambda: fleet.is_ready("ingest") or process.popen.poll() is not None, "ingest ready")
        yield fleet
        process.send(signal.SIGTERM)
        process.ended(within_s=SOON_S)


def kept_count(log_folder: Path) -> int:
    """How many vehicles' events a log holds."""
    log = McapLog(log_folder)
    try:
        return sum(log.next_number(stream) for stream in log.streams() if stream.startswith("veh-"))
    finally:
        log.close()


def median(values: Sequence[float]) -> float:
    """The middle one of an odd number of values."""
    return sorted(values)[len(values) // 2]
