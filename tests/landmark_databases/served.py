"""The projection as the process an operator runs: `trigpoint serve landmarks`."""

import json
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.error import URLError
from urllib.request import urlopen

import psycopg

from landmark_databases.cluster import Cluster, free_port

PROGRAM = Path(sys.executable).with_name("trigpoint")
LOOK_S = 0.05
CONFIGURATION = """
[fleet]
data = {data}
[bus]
mode = "peer"
connect = []
scouting = false
[database]
url = {url}
password_file = {password_file}
[landmarks]
batch_events = {batch_events}
retry_limit_s = 1.0
[http]
landmarks_port = {port}
"""


class ServedProjection:
    """A process that projects the log of a data directory into a database, started as often as wanted."""

    def __init__(self, data: Path, cluster: Cluster, database: str, *, batch_events: int = 20_000) -> None:
        self._port = free_port()
        self._config = data / "serve.toml"
        self._said = data / "serve.log"
        self._process: subprocess.Popen[bytes] | None = None
        values = {"data": str(data), "url": cluster.url(database), "password_file": str(cluster.password_file)}
        quoted = {name: json.dumps(value) for name, value in values.items()}
        text = CONFIGURATION.format(port=self._port, batch_events=batch_events, **quoted)
        self._config.write_text(text, encoding="utf-8")

    @property
    def pid(self) -> int:
        """The process's number, while it runs."""
        assert self._process is not None
        return self._process.pid

    def start(self) -> None:
        """The process runs; it may take a moment until it works."""
        with self._said.open("ab") as said:
            self._process = subprocess.Popen(
                [str(PROGRAM), "serve", "landmarks", "--config", str(self._config)],
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=said,
            )

    def kill(self) -> None:
        """The process is gone, by SIGKILL."""
        assert self._process is not None
        self._process.kill()
        self._process.wait()

    def is_ready(self) -> bool:
        """Whether it says that the database has everything the log has. Raises OSError if it ended."""
        assert self._process is not None
        if self._process.poll() is not None:
            raise OSError(f"the projection ended: {self._said.read_text(encoding='utf-8')[-2000:]}")
        try:
            with urlopen(f"http://127.0.0.1:{self._port}/readyz", timeout=5.0) as answer:
                return bool(answer.status == 200)
        except (URLError, OSError):
            return False


@contextmanager
def projecting(data: Path, cluster: Cluster, database: str, *, batch_events: int) -> Iterator[ServedProjection]:
    """The process at work; killed in the end."""
    served = ServedProjection(data, cluster, database, batch_events=batch_events)
    served.start()
    try:
        yield served
    finally:
        served.kill()


def wait_until(holds: Callable[[], bool], *, limit_s: float, seen: Callable[[], None] = lambda: None) -> None:
    """Returns once it holds; `seen` is called at every look. Raises TimeoutError after `limit_s`."""
    pause = threading.Event()
    for _ in range(round(limit_s / LOOK_S)):
        if holds():
            return
        seen()
        pause.wait(LOOK_S)
    raise TimeoutError(f"not so within {limit_s:g} s")


def taken_in(cluster: Cluster, database: str) -> int:
    """How many events of the optimiser's stream the database has taken in; 0 while the server is away."""
    try:
        with cluster.connected(database) as connection:
            found = connection.execute("SELECT max(next_number) FROM log_checkpoints").fetchone()
    except psycopg.Error:  # the server is away, or the tables are not there yet: nothing is known to be taken in
        return 0
    return int(found[0] or 0) if found else 0
