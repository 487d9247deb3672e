"""LAS and LAZ files read in a process of their own, which a damaged one may end, and nothing else with it."""

import multiprocessing
import os
import resource
import signal
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import TracebackType
from typing import Self

from trigpoint.errors import InputError, ServiceError
from trigpoint_vehicle.las_files import LasPoints, las_points

READING_LIMIT_S = 60.0  # for a file: the most points a scan may have take 2 s
MEMORY_LIMIT_BYTES = 4 * 1024**3  # of the process: the most points a scan may have take 0.5 GB
READY = "ready"


class LasReader:
    """Reads LAS and LAZ files one after another, in a process begun with the first, and anew after one that ended it.

    Their library's native code aborts where a damaged file asks for more memory than there is, and its Python code
    counts to whatever number of records a header claims: neither can be caught where it happens.
    """

    def __init__(self, *, limit_s: float = READING_LIMIT_S) -> None:
        self._limit_s = limit_s
        self._process: BaseProcess | None = None
        self._line: Connection | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def points(self, path: Path) -> LasPoints:
        """The points of a file. Raises InputError naming the file and what of it is wrong, or how it ended the process;
        ServiceError where there can be no process.
        """
        line = self._line or self._begun()
        try:
            line.send(str(path))
            said: LasPoints | str = line.recv()
        except (EOFError, OSError) as error:
            raise InputError(f"{path}: no LAS or LAZ file that can be read: {self._end()}") from error
        if isinstance(said, str):
            raise InputError(said)
        return said

    def close(self) -> None:
        """The process, if there is one, ended."""
        if self._process is not None and self._line is not None:
            self._line.close()
            self._process.kill()
            self._process.join()
            self._process = self._line = None

    def _begun(self) -> Connection:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        arguments = (theirs, self._limit_s)
        self._process = context.Process(target=_read_for, args=arguments, name="read-las", daemon=True)
        self._process.start()
        theirs.close()
        self._line = ours
        try:
            ours.recv()
        except EOFError as error:
            raise ServiceError(f"the process that reads LAS files did not begin: {self._end()}") from error
        return ours

    def _end(self) -> str:
        """How the process ended by itself, which is then forgotten."""
        assert self._process is not None
        self._process.join()
        status = self._process.exitcode or 0
        self.close()
        if status == -signal.SIGALRM:
            return f"it takes more than {self._limit_s:g} s"
        if status == -signal.SIGABRT:
            return f"decoding it aborted (SIGABRT), as it does for more memory than {MEMORY_LIMIT_BYTES} bytes"
        return f"reading it ended its process with status {status}"


def _read_for(line: Connection, limit_s: float) -> None:
    """Files read as their paths come, until none will; each is answered by its points, or by what is wrong with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who asked is interrupted too, and ends this process
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    _, most = resource.getrlimit(resource.RLIMIT_DATA)
    limit_bytes = MEMORY_LIMIT_BYTES if most == resource.RLIM_INFINITY else min(MEMORY_LIMIT_BYTES, most)
    resource.setrlimit(resource.RLIMIT_DATA, (limit_bytes, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    line.send(READY)
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 2)  # native code writes there what the answer says better
    while True:
        try:
            path = Path(line.recv())
        except EOFError:
            return
        signal.setitimer(signal.ITIMER_REAL, limit_s)
        answer = _answer(path)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        line.send(answer)


def _answer(path: Path) -> LasPoints | str:
    try:
        return las_points(path)
    except InputError as error:
        return str(error)
