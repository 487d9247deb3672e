"""Services killed while drives are replayed, and half an hour of load: what differs in the end, and what has grown."""

import os
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

from figures.figure import Figure, Measurement, at_most
from figures.workbench import Workbench
from fleet_runs.driven import drive
from fleet_runs.driving import small_campus_drives
from fleet_runs.footprint import Growth, growth, last_share
from fleet_runs.killing import Killing
from fleet_runs.load import Load, loaded
from fleet_runs.outcome import Outcome, doubled, map_differences, outcome_of, stream_differences
from fleet_runs.running import FOLLOWERS, fleet_of, settle

KILLS = int(os.environ.get("KILLS", "20"))  # of each service
SOAK_S = float(os.environ.get("SOAK_S", "1800"))  # of load; its last two thirds are held flat
SPEED = 1.0
VEHICLES = 10
WAIT_MAX_S = 1.5  # before a kill
UP = "trigpoint up --config $WORK/trigpoint.toml"
WRITTEN = {"filtering": ("filtering",), "optimisation": ("optimisation", "odometry"), "landmarks": ()}


@lru_cache(maxsize=1)
def runs(folder: Path) -> tuple[Outcome, Outcome]:
    """The same drives through a fleet whose services are killed, and through one that is left in peace."""
    drives = small_campus_drives(folder / "campus")
    killing = Killing(services=FOLLOWERS, times_each=KILLS, wait_max_s=WAIT_MAX_S)
    outcomes = []
    for name, plan in (("killed", killing), ("whole", None)):
        fleet = fleet_of(folder / name)
        drive(fleet, drives, speed=SPEED, killing=plan)
        settle(fleet)
        outcomes.append(outcome_of(fleet))
    return outcomes[0], outcomes[1]


def differing(service: str) -> Figure:
    """What a killed service left otherwise than one in peace: events of its streams, rows of the database."""

    def measure(bench: Workbench) -> Measurement:
        killed, whole = runs(bench.folder)
        found = [
            *stream_differences(killed, whole, streams=WRITTEN[service]),
            *doubled(killed),
            *map_differences(killed, whole),
        ]
        return Measurement(value=float(len(found)), command=f"{UP} & kill -9, {KILLS} times each service")

    name = f"kill -9 of {service}, {KILLS} times: boots of its streams and rows of the final database that differ"
    return Figure(name=name, unit="", target=at_most(0.0), measure=measure)


@lru_cache(maxsize=1)
def growths(folder: Path) -> dict[str, Growth]:
    """How much each process grew in the last two thirds of the load."""
    services = ("router", "ingest", *FOLLOWERS)
    load = Load(vehicles=VEHICLES, duration_s=SOAK_S, interval_s=min(5.0, SOAK_S / 60.0))
    found = loaded(fleet_of(folder / "soak"), small_campus_drives(folder / "soak-campus"), services, load)
    return {name: growth(last_share(one, 2 / 3)) for name, one in found.footprints.items()}


def grown(name: str, unit: str, limit: float, value_of: Callable[[Growth], float]) -> Figure:
    """The largest growth of any process."""

    def measure(bench: Workbench) -> Measurement:
        found = {process: value_of(one) for process, one in growths(bench.folder).items()}
        largest = max(found, key=lambda process: found[process])
        return Measurement(value=found[largest], command=f"{UP}  # {VEHICLES} vehicles; largest: {largest}")

    minutes = f"in the last {SOAK_S / 90.0:.0f} of {SOAK_S / 60.0:.0f} minutes of load"
    return Figure(name=f"{name} {minutes}", unit=unit, target=at_most(limit), measure=measure)


FIGURES = (
    *(differing(service) for service in FOLLOWERS),
    grown("resident memory of a process grown", "%", 5.0, lambda one: 100.0 * one.resident_share),
    grown("file handles of a process grown", "", 4.0, lambda one: one.handles),
)
