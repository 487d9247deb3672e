"""Damage to log files: random bit flips and truncations, each found, the rest read, what is recovered verified."""

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

from damaged_logs.campaign import REAL_EVERY, Case, cases, sealed_log
from figures.figure import Bounds, Figure, Measurement, at_least, at_most
from figures.workbench import Workbench

FLIPS, CUTS = 1000, 100
SHOWN = (
    f"trigpoint log verify $WORK/damaged; trigpoint log recover $WORK/damaged $WORK/recovered  # one in {REAL_EVERY}"
)
IN_PROCESS = "a process of its own, the others by the command's function"


@cache
def damaged(folder: Path, program: tuple[str, ...], kind: str) -> Sequence[Case]:
    """Every case of one kind of damage, once a run."""
    own = folder / f"damaged-logs-{kind}"
    own.mkdir()
    seeds = range(FLIPS if kind == "flip" else CUTS)
    return cases(sealed_log(own / "whole"), own, kind=kind, seeds=seeds, program=program)


def counted(name: str, kind: str, unit: str, target: Bounds, value_of: Callable[[Case], int]) -> Figure:
    """The sum of something over all cases of a kind."""

    def measure(bench: Workbench) -> Measurement:
        value = sum(map(value_of, damaged(bench.folder, bench.program, kind)))
        return Measurement(value=value, command=f"{SHOWN} in {IN_PROCESS}")

    return Figure(name=name, unit=unit, target=target, measure=measure)


FIGURES = (
    counted(f"{FLIPS} bit flips, found by verify", "flip", "flips", at_least(FLIPS), lambda case: case.found),
    counted(f"{FLIPS} bit flips, recovered, opened, verified", "flip", "logs", at_least(FLIPS), lambda c: c.recovered),
    counted(
        f"{FLIPS} bit flips, events of untouched chunks not back", "flip", "events", at_most(0), lambda c: c.unread
    ),
    counted(f"{FLIPS} bit flips, events other than written", "flip", "events", at_most(0), lambda case: case.wrong),
    counted(f"{CUTS} truncations, found by verify", "cut", "cuts", at_least(CUTS), lambda case: case.found),
    counted(f"{CUTS} truncations, recovered, opened, verified", "cut", "logs", at_least(CUTS), lambda c: c.recovered),
    counted(
        f"{CUTS} truncations, events of untouched chunks not back", "cut", "events", at_most(0), lambda c: c.unread
    ),
    counted(f"{CUTS} truncations, events other than written", "cut", "events", at_most(0), lambda case: case.wrong),
)
