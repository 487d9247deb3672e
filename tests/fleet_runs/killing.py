"""Services killed by signal 9 at random moments, and started again by whoever supervises them."""

import json
import os
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from random import Random

from command_runs.processes import Fleet, wait_until
from fleet_runs.running import SETTLE_S, alone

WORK_MAX_S = 3.0  # of a service between its start and its end


@dataclass(frozen=True, slots=True, kw_only=True)
class Killing:
    """Each of the services killed so many times, at random moments within a time, independently of the others."""

    services: tuple[str, ...]
    times_each: int
    within_s: float
    seed: int = 1

    def moments_s(self, name: str) -> list[float]:
        """When a service is killed, in order, from the beginning on."""
        die = Random(f"{self.seed}/{name}")
        return sorted(die.uniform(0.0, self.within_s) for _ in range(self.times_each))


def pid_of(fleet: Fleet, name: str) -> int | None:
    """The process of a service, as its supervisor tells; None between an end and the next start."""
    pid: int | None = fleet.told("up", "/healthz")["processes"][name]["pid"]
    return pid


def kill(fleet: Fleet, name: str) -> None:
    """The service killed; another process of it runs when this returns."""
    killed = pid_of(fleet, name)
    assert killed is not None, f"{name} is at work"
    os.kill(killed, signal.SIGKILL)
    wait_until(lambda: pid_of(fleet, name) not in (None, killed), f"another {name} runs")


def kill_all(fleet: Fleet, killing: Killing) -> None:
    """Every service killed as often as it should be: not before its moment, and after some work of its own."""
    began_s = time.monotonic()

    def kill_one(name: str) -> None:
        pause, die = threading.Event(), Random(f"{killing.seed}/{name}/work")
        for moment_s in killing.moments_s(name):
            pause.wait(max(began_s + moment_s - time.monotonic(), 0.0))
            wait_until(lambda: is_at_work(fleet, name), f"{name} at work", within_s=SETTLE_S)
            pause.wait(die.uniform(0.0, WORK_MAX_S))
            kill(fleet, name)

    with ThreadPoolExecutor(max_workers=len(killing.services)) as pool:
        for done in [pool.submit(kill_one, name) for name in killing.services]:
            done.result()


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
    return status != 0 and json.loads(page)["stage"] == "running"
