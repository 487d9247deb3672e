"""A Dask scheduler and its workers, each a process, for as long as it is open."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from command_runs.processes import free_ports, wait_until
from trigpoint.errors import ServiceError
from trigpoint.workers import workers

BEGUN_S = 60.0  # a scheduler and its workers, each with a nanny


@contextmanager
def running_workers(folder: Path, count: int) -> Iterator[str]:
    """The address of a scheduler on loopback with so many workers, each a process of one thread; what they say goes
    into files of the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    host, port = "127.0.0.1", str(free_ports(1)[0])
    address = f"tcp://{host}:{port}"
    worker = ("dask_worker", address, "--nworkers", str(count), "--nthreads", "1", "--no-dashboard")
    begun = [_program(folder, "dask_scheduler", "--host", host, "--port", port, "--no-dashboard")]
    try:
        begun.append(_program(folder, *worker, "--local-directory", str(folder)))
        wait_until(lambda: worker_count(address) == count, f"{count} workers", within_s=BEGUN_S)
        yield address
    finally:
        for process in reversed(begun):
            process.terminate()
            process.wait()


def worker_count(address: str) -> int:
    """How many workers a scheduler has, 0 while none answers."""
    try:
        with workers(address) as found:
            return found.threads
    except ServiceError:
        return 0


def _program(folder: Path, name: str, *arguments: str) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    with (folder / f"{name}.err").open("wb") as output:
        command = [sys.executable, "-m", f"distributed.cli.{name}", *arguments]
        return subprocess.Popen(command, env=environment, stdout=output, stderr=output)
