"""Ingest killed again and again under load, and its disk full for a minute."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

from figures.figure import Bounds, Figure, Measurement, at_most
from figures.workbench import CommandFailed, Workbench
from ingest_load.filling import Filled, filled_up
from ingest_load.killing import Survived, killed_under_load

KILLS = 100
FULL_S = 60.0
KILLED = f"trigpoint serve ingest, killed by SIGKILL {KILLS} times; python -m ingest_load.publishers"
FILLED = "trigpoint serve ingest --config … on a file system filled up; python -m ingest_load.publishers"


@cache
def survived(folder: Path) -> Survived:
    """What was left after all kills, once a run."""
    return killed_under_load(folder / "killed", kills=KILLS)


@cache
def filled(folder: Path) -> Filled:
    """What came of the full disk, once a run. Raises CommandFailed where mounting is not allowed."""
    try:
        return filled_up(folder / "filled", full_s=FULL_S)
    except PermissionError as error:
        raise CommandFailed(f"no file system of its own can be mounted: {error}") from error


def of_kills(name: str, value_of: Callable[[Survived], int], target: Bounds | None) -> Figure:
    """A count over all vehicles after the kills."""

    def measure(bench: Workbench) -> Measurement:
        return Measurement(value=value_of(survived(bench.folder)), command=KILLED)

    return Figure(name=f"{KILLS} kills of ingest under load, {name}", unit="messages", target=target, measure=measure)


def of_full_disk(name: str, value_of: Callable[[Filled], int], target: Bounds | None) -> Figure:
    """A count over all vehicles while or after the disk was full."""

    def measure(bench: Workbench) -> Measurement:
        return Measurement(value=value_of(filled(bench.folder)), command=FILLED)

    return Figure(name=f"disk full for {FULL_S:.0f} s, {name}", unit="messages", target=target, measure=measure)


NONE = at_most(0)
FIGURES = (
    of_kills("sent", lambda one: one.kept.sent, None),
    of_kills("lost", lambda one: one.kept.lost + (0 if one.acknowledged else one.kept.sent), NONE),
    of_kills("stored twice", lambda one: one.kept.twice, NONE),
    of_kills("out of order", lambda one: one.kept.out_of_order, NONE),
    of_full_disk("acknowledged meanwhile", lambda one: one.acknowledged_while_full, NONE),
    of_full_disk("waiting with the vehicles at its end", lambda one: one.waiting_when_freed, None),
    of_full_disk("lost", lambda one: one.kept.lost + (0 if one.all_acknowledged else one.kept.sent), NONE),
    of_full_disk("stored twice", lambda one: one.kept.twice, NONE),
)
