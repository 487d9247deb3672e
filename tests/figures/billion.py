"""One billion points, a drive replayed as a fleet, to web tiles: how large the process grows, and how fast it stays."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from figures.figure import Bounds, Figure, Measurement, at_least, at_most
from figures.workbench import CommandFailed, Workbench
from replayed_fleets.replaying import points_of, record_drive

DRIVES = int(os.environ.get("DRIVES", "51"))  # the least that hold a billion points
GIBIBYTE, MILLION = 1024.0**3, 1e6


@dataclass(frozen=True, slots=True)
class Rendering:
    """What rendering a fleet's points took; `disk_bytes`: of what it left, which is removed."""

    points: int
    wall_s: float
    cpu_s: float
    peak_bytes: int
    disk_bytes: int

    @property
    def points_per_s(self) -> float:
        """By the clock on the wall."""
        return self.points / self.wall_s


@cache
def rendering(folder: Path, drives: int) -> Rendering:
    """A fleet rendered by a process of its own. Raises CommandFailed."""
    if not (folder / "log").exists():
        record_drive(folder / "log")
    command = [sys.executable, "-m", "replayed_fleets", str(folder), str(drives)]
    finished = subprocess.run(command, stdout=subprocess.PIPE, check=False)
    if finished.returncode != 0:
        raise CommandFailed(f"{' '.join(command)}: exit status {finished.returncode}")
    said, out = json.loads(finished.stdout), folder / "out"
    disk_bytes = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
    shutil.rmtree(out)
    return Rendering(said["points"], said["wall_s"], said["cpu_s"], said["peak_bytes"], disk_bytes)


def of_fleet(name: str, unit: str, target: Bounds | None, value: Callable[[Rendering, Rendering], float]) -> Figure:
    """A figure of the fleet's rendering, and that of one drive of it."""

    def measure(bench: Workbench) -> Measurement:
        folder = bench.folder / "fleet"
        small = rendering(folder, 1)
        found = value(rendering(folder, DRIVES), small)
        return Measurement(value=found, command=f"python -m replayed_fleets $WORK/fleet {DRIVES}")

    return Figure(
        name=f"{points_of(DRIVES) / MILLION:.0f} million points to web tiles: {name}",
        unit=unit,
        target=target,
        measure=measure,
    )


FIGURES = (
    of_fleet("peak memory of the process", "GiB", at_most(6.0), lambda found, _: found.peak_bytes / GIBIBYTE),
    of_fleet("peak memory with 20 million", "GiB", None, lambda _, small: small.peak_bytes / GIBIBYTE),
    of_fleet(
        "points/s over those of 20 million",
        "x",
        at_least(0.7),
        lambda found, small: found.points_per_s / small.points_per_s,
    ),
    of_fleet("by the clock", "million points/s", None, lambda found, _: found.points_per_s / MILLION),
    of_fleet("by its processor time", "million points/s", None, lambda found, _: found.points / found.cpu_s / MILLION),
    of_fleet("disk", "GiB", at_most(20.0), lambda found, _: found.disk_bytes / GIBIBYTE),
)
