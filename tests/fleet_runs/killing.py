"""Services killed by signal 9 at random moments, and started again by whoever supervises them."""

import http.client
import json
import os
import signal
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from random import Random

from command_runs.processes import Fleet, wait_until
from fleet_runs.running import alone


@dataclass(frozen=True, slots=True, kw_only=True)
class Killing:
    """Each of the services killed so many times, in random order, after a random wait each."""

    services: tuple[str, ...]
    times_each: int
    wait_min_s: float = 0.1
    wait_max_s: float = 3.0
    seed: int = 1

    def order(self) -> list[tuple[str, float]]:
        """Whom to kill, and after which wait."""
        die = Random(self.seed)
        names = [name for name in self.services for _ in range(self.times_each)]
        die.shuffle(names)
        return [(name, die.uniform(self.wait_min_s, self.wait_max_s)) for name in names]


def pid_of(fleet: Fleet, name: str) -> int | None:
    """The process of a service, as its supervisor tells; None between an end and the next start."""
    pid: int | None = fleet.told("up", "/healthz")["processes"][name]["pid"]
    return pid


def kill(fleet: Fleet, name: str) -> None:
    """The service killed; another process of it runs when this returns."""
    wait_until(lambda: pid_of(fleet, name) is not None, f"{name} runs")
    killed = pid_of(fleet, name)
    assert killed is not None
    os.kill(killed, signal.SIGKILL)
    wait_until(lambda: pid_of(fleet, name) not in (None, killed), f"another {name} runs")


def kill_all(fleet: Fleet, killing: Killing) -> Sequence[str]:
    """Who was killed, in order."""
    pause = threading.Event()
    killed = []
    for name, wait_s in killing.order():
        pause.wait(wait_s)
        kill(fleet, name)
        killed.append(name)
    return killed


def kill_while_catching_up(fleet: Fleet, name: str, *, times: int, seed: int = 1, wait_max_s: float = 0.5) -> None:
    """One service started and killed so many times, each at a random moment of its work on what the log holds."""
    die, pause = Random(seed), threading.Event()
    for _ in range(times):
        with alone(fleet, name) as process:
            wait_until(lambda: is_at_work(fleet, name) or process.popen.poll() is not None, f"{name} at work")
            assert process.popen.poll() is None, process.err
            pause.wait(die.uniform(0.0, wait_max_s))
            process.send(signal.SIGKILL)
            process.ended()


def is_at_work(fleet: Fleet, name: str) -> bool:
    """Whether a service runs, ready or not."""
    status, page = fleet.page(name, "/healthz")
    return status == http.client.OK and json.loads(page)["stage"] == "running"
