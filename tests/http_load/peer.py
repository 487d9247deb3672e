"""tipg in an environment of its own, on the same database."""

import os
import subprocess
import sys
import tempfile
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote

from command_runs.processes import free_ports, wait_until
from landmark_databases.cluster import LOOPBACK, OWNER, PASSWORD, Cluster

WANTED = ("tipg>=1,<2", "uvicorn", "uvloop", "httptools")
ENVIRONMENT = Path(tempfile.gettempdir()) / f"trigpoint-tipg-{os.getuid()}"  # kept: it takes a minute to make
BUFFER = 64


def environment() -> Path:
    """The folder of an environment with tipg in it, made where it is not there. Raises OSError if it cannot be."""
    if not (ENVIRONMENT / "made").is_file():
        for command in (
            [sys.executable, "-m", "venv", str(ENVIRONMENT)],
            [str(ENVIRONMENT / "bin" / "pip"), "install", "--quiet", *WANTED],
        ):
            finished = subprocess.run(command, capture_output=True, text=True, check=False)
            if finished.returncode != 0:
                raise OSError(f"no environment for tipg: {finished.stderr.strip()[-300:]}")
        (ENVIRONMENT / "made").touch()
    return ENVIRONMENT


@contextmanager
def served_tipg(cluster: Cluster, database: str, folder: Path) -> Iterator[str]:
    """Where it answers: one process, on the same event loop and parser as ours."""
    (port,) = free_ports(1)
    settings = {
        "DATABASE_URL": f"postgresql://{OWNER}:{quote(PASSWORD)}@{LOOPBACK}:{cluster.port}/{database}",
        "TIPG_CATALOG_TTL": "3600",
        "TIPG_TILE_BUFFER": str(BUFFER),
        "PATH": os.environ["PATH"],
    }
    program = [str(environment() / "bin" / "uvicorn"), "tipg.main:app", "--port", str(port), "--log-level", "warning"]
    with (folder / "tipg.log").open("wb") as said:
        popen = subprocess.Popen(
            [*program, "--loop", "uvloop", "--http", "httptools"], cwd=folder, env=settings, stdout=said, stderr=said
        )
    url = f"http://{LOOPBACK}:{port}"
    try:
        wait_until(lambda: _answers(f"{url}/collections"), "tipg answers")
        yield url
    finally:
        popen.kill()
        popen.wait()


def _answers(url: str) -> bool:
    try:
        with urllib.request.urlopen(url, timeout=5.0) as answer:
            return bool(answer.status == 200)
    except (urllib.error.URLError, OSError):
        return False
