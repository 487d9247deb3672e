"""A `trigpoint` process of its own, what it logs, and what it answers over HTTP."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PROGRAM = (sys.executable, "-c", "from trigpoint_cli.app import main; main()")
START_S, STOP_S = 60.0, 30.0  # on two shared cores an interpreter with numpy and pyproj may take ten seconds
LOOK_S = 0.02
LOOPBACK = "127.0.0.1"


def free_port() -> int:
    """A TCP port on loopback that nobody listens on."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port


def comes_true(condition: Callable[[], bool], *, within_s: float) -> bool:
    """Whether a condition holds now or soon."""
    end_s = time.monotonic() + within_s
    while not condition():
        if time.monotonic() > end_s:
            return False
        time.sleep(LOOK_S)
    return True


@dataclass(frozen=True, slots=True)
class RunningProcess:
    """One process; `port` is that of its HTTP endpoint."""

    process: "subprocess.Popen[bytes]"
    port: int
    errors: Path

    @property
    def log(self) -> str:
        """What it wrote on standard error so far."""
        return self.errors.read_text(encoding="utf-8", errors="replace")

    def rows(self) -> list[dict[str, Any]]:
        """Its log lines that are JSON."""
        return [json.loads(line) for line in self.log.splitlines() if line.startswith("{")]

    def page(self, path: str) -> tuple[int, str]:
        """Status and body of a page of its endpoint; 0 where nothing answers."""
        try:
            with urllib.request.urlopen(f"http://{LOOPBACK}:{self.port}{path}", timeout=5.0) as answer:
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()
        except OSError:
            return 0, ""

    def is_ready(self) -> bool:
        """Whether it says that it has caught up. Raises AssertionError with its log if it has ended."""
        assert self.process.poll() is None, self.log
        return self.page("/readyz")[0] == 200

    def metric(self, name: str) -> float:
        """The sum of a metric over its labels, 0 where it has none yet."""
        body = self.page("/metrics")[1]
        return sum(float(found) for found in re.findall(rf"^{name}(?:{{.*?}})? (\S+)$", body, flags=re.MULTILINE))

    def stop(self, kind: signal.Signals = signal.SIGTERM) -> int:
        """Its exit status after a signal."""
        self.process.send_signal(kind)
        return self.process.wait(STOP_S)


@contextmanager
def running(
    folder: Path, *words: str | Path, port: int, environment: Mapping[str, str] | None = None
) -> Iterator[RunningProcess]:
    """A `trigpoint` process that became ready; killed in the end if it still runs."""
    errors = folder / f"{words[1] if words[0] == 'serve' else words[0]}-{port}.log"
    with errors.open("wb") as file:
        process = subprocess.Popen(
            [*PROGRAM, *map(str, words)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=file,
            env={**os.environ, **(environment or {})},
        )
    started = RunningProcess(process, port, errors)
    try:
        assert comes_true(started.is_ready, within_s=START_S), started.log
        yield started
    finally:
        if process.poll() is None:
            process.kill()
        process.wait(STOP_S)
