"""Load on a running fleet for as long as is wanted, and what its processes hold meanwhile."""

import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count

from command_runs.processes import Fleet, trigpoint_process
from fleet_runs.driving import Rows, again, vehicles_on_the_road
from fleet_runs.footprint import Footprint, watched
from fleet_runs.killing import pid_of
from trigpoint.events.observed import VehicleDescribed


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """So many vehicles, each driving without end, for so long; `speed` times faster than they were recorded."""

    vehicles: int
    duration_s: float
    speed: float = 1.0
    interval_s: float = 1.0  # between two looks at the processes


@dataclass(frozen=True, slots=True, kw_only=True)
class Loaded:
    """What was sent, and what each process held, in order of time."""

    sent: int
    footprints: Mapping[str, Sequence[Footprint]]


def driven_by(rows: Rows, vehicle: str) -> Rows:
    """The same drive, driven by another vehicle."""

    def renamed(event: object) -> object:
        return replace(event, vehicle=vehicle) if isinstance(event, VehicleDescribed) else event

    return [
        replace(row, identity=replace(row.identity, source=vehicle), event=renamed(row.event))  # type: ignore[arg-type]
        for row in rows
    ]


def without_end(rows: Rows) -> Iterator[Rows]:
    """The drive driven again and again, each time under a boot of its own."""
    return (again(rows, times) for times in count())


def loaded(fleet: Fleet, drives: Sequence[Rows], services: Sequence[str], load: Load) -> Loaded:
    """A fleet under load, stopped in order afterwards; every event that was sent is acknowledged."""
    fleets = [without_end(driven_by(drives[n % len(drives)], f"veh-{n}")) for n in range(load.vehicles)]
    with trigpoint_process(fleet.folder, "up", "--config", fleet.config) as up:
        fleet.wait_ready(*services)
        pids = {name: pid for name in services if (pid := pid_of(fleet, name)) is not None}
        with (
            vehicles_on_the_road(fleets, fleet.endpoint, speed=load.speed) as vehicles,
            watched({**pids, "up": up.popen.pid}, interval_s=load.interval_s) as footprints,
        ):
            threading.Event().wait(load.duration_s)
        assert {name: pid_of(fleet, name) for name in services} == pids, up.err
        assert up.stop() == 0, up.err
    return Loaded(sent=sum(vehicle.sent for vehicle in vehicles), footprints=footprints)
