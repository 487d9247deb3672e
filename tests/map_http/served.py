"""`trigpoint serve http` as an operator runs it, on a database and a log of its own."""

import json
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from command_runs.processes import CLEAN, free_ports, wait_until

CONFIGURATION = """
[fleet]
data = {data}
[bus]
mode = "peer"
connect = []
scouting = false
[database]
{database}
[web]
port = {port}
listen_to_bus = false
look_s = 0.05
{web}
[http]
http_port = {health_port}
"""


@dataclass(frozen=True, slots=True)
class ServedMap:
    """A process that serves a map."""

    url: str
    health_url: str
    said: Path
    popen: "subprocess.Popen[bytes]"

    def answers(self, path: str) -> int:
        """The status of a page of the service's health, 0 where nobody answers."""
        try:
            with urllib.request.urlopen(f"{self.health_url}{path}", timeout=5.0) as answer:
                return int(answer.status)
        except urllib.error.HTTPError as error:
            return error.code
        except OSError:
            return 0

    def told(self, path: str) -> Any:
        """The JSON at a path."""
        with urllib.request.urlopen(f"{self.url}{path}", timeout=30.0) as answer:
            return json.load(answer)


def configuration(data: Path, *, database: str, web: str = "") -> tuple[str, int, int]:
    """The text of a configuration, the service's port, and that of its health."""
    port, health_port = free_ports(2)
    text = CONFIGURATION.format(
        data=json.dumps(str(data)), database=database, port=port, web=web, health_port=health_port
    )
    return text, port, health_port


@contextmanager
def served_map(folder: Path, *, database: str, web: str = "", data: Path | None = None) -> Iterator[ServedMap]:
    """The process at work and ready; `database` and `web` are lines of those sections. Told to stop in the end."""
    text, port, health_port = configuration(data or folder, database=database, web=web)
    config, said = folder / "http.toml", folder / "http.log"
    config.write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "trigpoint_cli", "serve", "http", "--config", str(config)]
    with said.open("wb") as output:
        popen = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=output, stderr=output, env=CLEAN)
    served = ServedMap(f"http://127.0.0.1:{port}", f"http://127.0.0.1:{health_port}", said, popen)
    try:
        wait_until(lambda: served.answers("/readyz") == 200 or popen.poll() is not None, f"ready: {said}")
        assert popen.poll() is None, said.read_text(encoding="utf-8")
        yield served
    finally:
        popen.terminate()
        popen.wait(30.0)


def geopackage_line(path: Path) -> str:
    """The [database] section's line for a file."""
    return f"url = {json.dumps(f'geopackage:{path}')}"
