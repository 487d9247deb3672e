"""Commands as processes of their own, with signals, exit statuses and everything they said."""

import http.client
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

SERVICES = ("router", "ingest", "filtering", "optimisation", "landmarks")
LOOK_S = 0.02  # between two looks at what is waited for
SOON_S = 60.0  # what takes a second here takes many beside eight other jobs
START_S = 240.0  # for every process of a fleet, one after the other
CLEAN = {name: text for name, text in os.environ.items() if not name.startswith("TRIGPOINT_")}


def free_ports(count: int) -> list[int]:
    """Ports on loopback that nobody listens on, no two the same."""
    probes = [socket.socket() for _ in range(count)]
    for probe in probes:
        probe.bind(("127.0.0.1", 0))
    ports: list[int] = [probe.getsockname()[1] for probe in probes]
    for probe in probes:
        probe.close()
    return ports


def comes_true(holds: Callable[[], bool], *, within_s: float = SOON_S) -> bool:
    """Whether it holds now or soon: loopback takes milliseconds, the rest is a slow machine's share."""
    deadline_s, pause = time.monotonic() + within_s, threading.Event()
    while not holds():
        if time.monotonic() > deadline_s:
            return False
        pause.wait(LOOK_S)
    return True


def wait_until(holds: Callable[[], bool], what: str, *, within_s: float = SOON_S) -> None:
    """Returns once it holds; fails with what was waited for."""
    assert comes_true(holds, within_s=within_s), f"not within {within_s:g} s: {what}"


def runs(pid: int) -> bool:
    """Whether the process is there and not merely waiting to be waited for."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
    return state not in ("Z", "X")


def children_of(pid: int) -> list[int]:
    """The processes that one has begun, from any of its threads, and that are there."""
    lists = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(word) for path in lists for word in path.read_text(encoding="ascii").split()]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fleet:
    """A folder with a configuration whose endpoints are free here."""

    folder: Path
    ports: dict[str, int]
    endpoint: str

    @property
    def config(self) -> Path:
        """The configuration's file."""
        return self.folder / "trigpoint.toml"

    @property
    def data(self) -> Path:
        """The data directory."""
        return self.folder / "data"

    def page(self, process: str, path: str) -> tuple[int, str]:
        """Status and text of a page of a process; status 0 where nobody answers."""
        connection = http.client.HTTPConnection("127.0.0.1", self.ports[process], timeout=5.0)
        try:
            connection.request("GET", path)
            answer = connection.getresponse()
            return answer.status, answer.read().decode()
        except (OSError, http.client.HTTPException):
            return 0, ""
        finally:
            connection.close()

    def told(self, process: str, path: str) -> Any:
        """The JSON object at a page of a process."""
        return json.loads(self.page(process, path)[1])

    def is_ready(self, process: str) -> bool:
        """Whether a process says it is."""
        return self.page(process, "/readyz")[0] == http.client.OK

    def wait_ready(self, *processes: str) -> None:
        """Returns once all of them are ready."""
        wait_until(lambda: all(map(self.is_ready, processes)), f"{processes} ready", within_s=START_S)


def fleet_in(folder: Path, toml: str = "") -> Fleet:
    """A fleet of one machine in a folder; `toml` is added to its configuration."""
    folder.mkdir(parents=True, exist_ok=True)
    numbers = free_ports(len(SERVICES) + 2)
    ports = dict(zip(("up", *SERVICES), numbers, strict=False))
    fleet = Fleet(folder=folder, ports=ports, endpoint=f"tcp/127.0.0.1:{numbers[-1]}")
    lines = [f"{name}_port = {port}" for name, port in ports.items()]
    head = f'[fleet]\ndata = "{fleet.data}"\n[bus]\nmode = "client"\nconnect = ["{fleet.endpoint}"]\n'
    router = f'connect_timeout_s = 30.0\n[router]\nmode = "router"\nlisten = ["{fleet.endpoint}"]\n[http]\n'
    fleet.config.write_text(head + router + "\n".join(lines) + "\n" + toml, encoding="utf-8")
    return fleet


@dataclass(slots=True)
class Process:
    """A running `trigpoint`; its standard input is open until it is closed here."""

    popen: "subprocess.Popen[bytes]"
    out_path: Path
    err_path: Path
    words: Sequence[str] = field(default_factory=tuple)

    @property
    def err(self) -> str:
        """What it and its children logged so far."""
        return self.err_path.read_text(encoding="utf-8", errors="replace")

    @property
    def out(self) -> str:
        """What it said on standard output so far."""
        return self.out_path.read_text(encoding="utf-8")

    def logged(self) -> list[dict[str, Any]]:
        """The JSON lines it and its children logged so far; other lines fail."""
        return [json.loads(line) for line in self.err.splitlines()]

    def send(self, number: signal.Signals) -> None:
        """The signal sent to it."""
        self.popen.send_signal(number)

    def ended(self, *, within_s: float = SOON_S) -> int:
        """Its exit status, once it ended; negative: the signal that ended it."""
        return self.popen.wait(within_s)

    def stop(self) -> int:
        """Its exit status after SIGTERM."""
        self.send(signal.SIGTERM)
        return self.ended()


@contextmanager
def trigpoint_process(folder: Path, *words: str | Path | int) -> Iterator[Process]:
    """`trigpoint` with these words, running; killed at the end if it still does."""
    name = "-".join(str(word) for word in words[:2]) + f"-{time.monotonic_ns()}"
    out, err = folder / f"{name}.out", folder / f"{name}.err"
    command = [sys.executable, "-m", "trigpoint_cli", *map(str, words)]
    with out.open("wb") as out_file, err.open("wb") as err_file:
        popen = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=out_file, stderr=err_file, env=CLEAN)
    try:
        yield Process(popen, out, err, command)
    finally:
        if popen.poll() is None:
            popen.kill()
            popen.wait()
        if popen.stdin is not None:
            popen.stdin.close()
