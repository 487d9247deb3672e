"""A small campus, solved, and the processes that solve it again for every label, while it is looked at."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from command_runs.processes import fleet_in, free_ports, trigpoint_process
from command_runs.running import trigpoint
from command_runs.small_campus import write_small_campus
from trigpoint_landmarks.http.tokens import Scope, issue_token

SERVICES = ("router", "optimisation", "landmarks", "http")


@dataclass(frozen=True, slots=True)
class SolvedAgain:
    """Where the map is served, and a token to label with."""

    url: str
    token: str


def solved_campus(folder: Path) -> Path:
    """A data directory with the small campus's log and its first map version. Raises AssertionError."""
    data, written = folder / "data", write_small_campus(folder / "raw")
    assert trigpoint("ingest", *written.logs, "--data", data).status == 0
    assert trigpoint("anchors", "import", str(written.anchors), "--data", data).status == 0
    assert trigpoint("build", "--data", data).status == 0
    return data


@contextmanager
def solving(folder: Path) -> Iterator[SolvedAgain]:
    """The processes at work, until the end, on the small campus that was solved in the folder."""
    port, health_port = free_ports(2)
    tokens = folder / "tokens.json"
    web = {"port": port, "token_file": str(tokens), "look_s": 0.2}
    lines = [f"{name} = {json.dumps(value)}" for name, value in web.items()]
    toml = f"http_port = {health_port}\n[up]\nservices = {json.dumps(SERVICES)}\n[web]\nopen_reading = true\n"
    fleet = fleet_in(folder, toml + "\n".join(lines) + "\n")
    fleet = replace(fleet, ports={**fleet.ports, "http": health_port})
    _, token = issue_token(tokens, "ann", Scope.LABEL, now_s=0)
    with trigpoint_process(folder, "up", "--config", fleet.config) as process:
        fleet.wait_ready(*SERVICES)
        yield SolvedAgain(f"http://127.0.0.1:{port}", token)
        process.stop()
