"""Work that a cluster's workers import by name."""

import os
from dataclasses import dataclass
from pathlib import Path

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
