"""Work that a cluster's workers import by name."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from trigpoint.logs.mcap_log import McapLog

DEADLY = -1


@dataclass(frozen=True, slots=True)
class Squared:
    """A square, and the process that made it."""

    value: int
    pid: int


def squared(number: int) -> Squared:
    """The square."""
    return Squared(number * number, os.getpid())


def deadly(number: int) -> int:
    """The number; DEADLY ends the process."""
    if number == DEADLY:
        os._exit(1)
    return number


def deadly_once(item: tuple[int, Path]) -> int:
    """The number; the first to be asked for one ends its process, and leaves a file that says so."""
    number, died = item
    if number == 1 and not died.exists():
        died.touch()
        os._exit(1)
    return number


@contextmanager
def opened_log(folder: Path) -> Iterator[McapLog]:
    """A log, open for one piece."""
    log = McapLog(folder)
    yield log
    log.close()


@contextmanager
def opened_after_a_death(folder: Path, died: Path) -> Iterator[McapLog]:
    """A log; the first to open it ends its process, and leaves a file that says so."""
    if not died.exists():
        died.touch()
        os._exit(1)
    with opened_log(folder) as log:
        yield log
