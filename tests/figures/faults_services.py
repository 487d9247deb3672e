"""Services killed while drives are replayed, and half an hour of load: what differs in the end, and what has grown."""

import os
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path

from figures.figure import Figure, Measurement, at_most
from figures.workbench import CommandFailed, Workbench
from fleet_runs.driven import drive, small_campus
from fleet_runs.footprint import Growth, growth, last_share
from fleet_runs.killing import Killing
from fleet_runs.load import POSES, VEHICLES, soaked
from fleet_runs.outcome import (
    Outcome,
    correction_differences,
    doubled,
    final_map_differences,
    outcome_of,
    replayed_differences,
    row_differences_of_newest_maps,
    stream_differences,
    version_faults,
)
from fleet_runs.running import FOLLOWERS, fleet_of, settle
from landmark_databases.cluster import binaries, running_cluster

KILLS = int(os.environ.get("KILLS", "20"))  # of each service
KILLED_WITHIN_S = 180.0  # at least; the shorter drive takes 193 s, the longer one 267 s
SOAK_S = float(os.environ.get("SOAK_S", "1800"))  # of load; its last two thirds are held flat
UP = "trigpoint up --config $WORK/trigpoint.toml"

Compared = Callable[[Outcome, Outcome], Sequence[str]]


@lru_cache(maxsize=1)
def runs(folder: Path) -> tuple[Outcome, Outcome]:
    """The same drives and labels through a fleet whose services are killed, and through one that is left in peace."""
    folder = folder / "services-killed"  # of its own: all figures of the group work in one folder
    campus = small_campus(folder / "campus")
    killing = Killing(services=FOLLOWERS, times_each=KILLS, within_s=KILLED_WITHIN_S)
    killed, whole = fleet_of(folder / "killed"), fleet_of(folder / "whole")
    rounds = drive(killed, campus, killing=killing)
    drive(whole, campus, rounds=rounds)
    settle(killed)
    settle(whole)
    return outcome_of(killed), outcome_of(whole)


def differing(service: str, what: str, compared: Compared) -> Figure:
    """What a killed service left otherwise than one in peace."""

    def measure(bench: Workbench) -> Measurement:
        killed, whole = runs(bench.folder)
        return Measurement(
            value=float(len(compared(killed, whole))), command=f"{UP} & kill -9, {KILLS} times each service"
        )

    return Figure(name=f"kill -9 of {service}, {KILLS} times: {what}", unit="", target=at_most(0.0), measure=measure)


def filtered_otherwise(killed: Outcome, whole: Outcome) -> Sequence[str]:
    """Boots of the filter's stream."""
    return [*stream_differences(killed, whole, streams=("filtering",)), *doubled(killed)]


def solved_otherwise(killed: Outcome, whole: Outcome) -> Sequence[str]:
    """Events of the final map, and what is amiss on the way to it."""
    return [
        *final_map_differences(killed, whole),
        *version_faults(killed),
        *correction_differences(killed, whole),
        *doubled(killed),
    ]


def stored_otherwise(killed: Outcome, whole: Outcome) -> Sequence[str]:
    """Rows of the final database: all against a replay of the log, those of the newest map against the other run's."""
    return [*replayed_differences(killed), *row_differences_of_newest_maps(killed, whole)]


@lru_cache(maxsize=1)
def growths(folder: Path) -> dict[str, Growth]:
    """How much each process grew in the last two thirds of the load."""
    if binaries() is None:
        raise CommandFailed("no PostgreSQL with PostGIS is installed")
    with running_cluster(durable=True) as cluster:
        found = soaked(folder / "soak", cluster, duration_s=SOAK_S)
    return {name: growth(last_share(one, 2 / 3)) for name, one in found.items()}


def grown(name: str, unit: str, limit: float, value_of: Callable[[Growth], float]) -> Figure:
    """The largest growth of any process."""

    def measure(bench: Workbench) -> Measurement:
        found = {process: value_of(one) for process, one in growths(bench.folder).items()}
        largest = max(found, key=lambda process: found[process])
        shown = f"{UP}  # {VEHICLES} vehicles, a live graph of {POSES} poses; largest: {largest}"
        return Measurement(value=found[largest], command=shown)

    minutes = f"in the last {SOAK_S / 90.0:.0f} of {SOAK_S / 60.0:.0f} minutes of load"
    return Figure(name=f"{name} {minutes}", unit=unit, target=at_most(limit), measure=measure)


FIGURES = (
    differing(
        "filtering", "drives whose estimates are not byte for byte those of an uninterrupted run", filtered_otherwise
    ),
    differing("optimisation", "events of the final map that differ, versions or places amiss before", solved_otherwise),
    differing("landmarks", "rows of the final database that differ", stored_otherwise),
    grown("resident memory of a process grown", "%", 5.0, lambda one: 100.0 * one.resident_share),
    grown("file handles of a process grown", "", 8.0, lambda one: one.handles),  # a solving process has five pipes
)
