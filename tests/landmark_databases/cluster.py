"""A PostgreSQL server of its own in a temporary folder, on loopback, with PostGIS to create in its databases."""

import os
import pwd
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from itertools import count
from pathlib import Path
from typing import Literal

import psycopg
import pytest

INSTALLED = Path("/usr/lib/postgresql")  # Debian's: one folder a major version
EXTENSIONS = Path("/usr/share/postgresql")
SERVER_USER = "postgres"  # PostgreSQL refuses to run as root
OWNER, PASSWORD = "trigpoint", "a secret of the tests"
LOOPBACK = "127.0.0.1"
WAIT_S = 60  # for the server to start or stop

StopMode = Literal["smart", "fast", "immediate"]


@lru_cache(maxsize=1)
def binaries() -> Path | None:
    """The folder of the newest PostgreSQL that has PostGIS, None where there is none."""
    found = [
        folder / "bin"
        for folder in INSTALLED.glob("*")
        if (folder / "bin" / "initdb").is_file()
        and (EXTENSIONS / folder.name / "extension" / "postgis.control").is_file()
    ]
    return max(found, key=lambda path: int(path.parent.name), default=None)


def free_port() -> int:
    """A TCP port on loopback that nobody listens on."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port


@dataclass(frozen=True, slots=True)
class Cluster:
    """One server: its files in `folder`, its port. Stopped and started anew it is on the same port."""

    folder: Path
    port: int
    numbers: "count[int]"

    @property
    def password_file(self) -> Path:
        """A file that holds the owner's password."""
        return self.folder / "password"

    @property
    def password_table(self) -> Path:
        """The same as PostgreSQL's own clients read it, named by PGPASSFILE."""
        return self.folder / "pgpass"

    def url(self, database: str) -> str:
        """The database's URL, without password."""
        return f"postgresql+psycopg://{OWNER}@{LOOPBACK}:{self.port}/{database}"

    def start(self) -> None:
        """The server answers."""
        options = f"-p {self.port} -c listen_addresses={LOOPBACK} -c unix_socket_directories={self.folder}"
        self._control("start", "-l", str(self.folder / "server.log"), "-o", options)

    def stop(self, mode: StopMode = "fast") -> None:
        """The server is gone; `immediate` is as if its power had failed."""
        self._control("stop", "-m", mode)

    def restart(self, mode: StopMode = "immediate") -> None:
        """The server is gone and answers again."""
        self.stop(mode)
        self.start()

    def created(self) -> str:
        """The name of a new, empty database with PostGIS in it."""
        name = f"map_{next(self.numbers)}"
        with self.connected("postgres") as connection:
            connection.execute(f"CREATE DATABASE {name} TEMPLATE with_postgis STRATEGY FILE_COPY")  # 4 x as quick
        return name

    @contextmanager
    def password_known(self) -> Iterator[None]:
        """PostgreSQL's clients of this process and its children find the password."""
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("PGPASSFILE", str(self.password_table))
            yield

    @contextmanager
    def connected(self, database: str) -> Iterator["psycopg.Connection"]:
        """A connection of the owner, each statement its own transaction."""
        with psycopg.connect(
            host=LOOPBACK, port=self.port, user=OWNER, password=PASSWORD, dbname=database, autocommit=True
        ) as connection:
            yield connection

    def _control(self, action: str, *words: str) -> None:
        _run("pg_ctl", "-D", str(self.folder / "data"), "-w", "-t", str(WAIT_S), *words, action)


def _run(program: str, *words: str) -> None:
    folder = binaries()
    assert folder is not None
    user = SERVER_USER if os.geteuid() == 0 else None
    finished = subprocess.run(
        [str(folder / program), *words],
        user=user,
        group=user,
        extra_groups=None if user is None else [],
        cwd="/",
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,  # never a pipe: the server would hold it open
        stderr=subprocess.DEVNULL,
        check=False,
    )
    if finished.returncode != 0:
        raise OSError(f"{program} {' '.join(words)} ended with status {finished.returncode}")


@contextmanager
def running_cluster(*, durable: bool) -> Iterator[Cluster]:
    """A new server, gone in the end with all its files; unless `durable` it never waits for the disk."""
    folder = Path(tempfile.mkdtemp(prefix="trigpoint-postgres-"))
    cluster = Cluster(folder, free_port(), count(1))
    try:
        cluster.password_file.write_text(f"{PASSWORD}\n", encoding="utf-8")
        cluster.password_table.write_text(f"*:*:*:{OWNER}:{PASSWORD}\n", encoding="utf-8")
        cluster.password_table.chmod(0o600)
        if os.geteuid() == 0:
            entry = pwd.getpwnam(SERVER_USER)
            for path in (folder, cluster.password_file):
                os.chown(path, entry.pw_uid, entry.pw_gid)
        words = ("-U", OWNER, "-A", "scram-sha-256", "--pwfile", str(cluster.password_file), "-E", "UTF8")
        _run("initdb", "-D", str(folder / "data"), "-N", "--locale", "C", *words)
        _configured(folder / "data" / "postgresql.conf", durable=durable)
        cluster.start()
        try:
            with cluster.connected("postgres") as connection:
                connection.execute("CREATE DATABASE with_postgis")
            with cluster.connected("with_postgis") as connection:
                connection.execute("CREATE EXTENSION postgis")
            yield cluster
        finally:
            cluster.stop("immediate")
    finally:
        shutil.rmtree(folder)


def _configured(path: Path, *, durable: bool) -> None:
    settings = ["shared_buffers = 128MB", "max_connections = 30"]
    if not durable:
        settings += ["fsync = off", "synchronous_commit = off", "full_page_writes = off"]
    with path.open("a", encoding="utf-8") as file:
        file.write("\n".join(["", *settings, ""]))
