"""Load on a running fleet for as long as is wanted, and what its processes hold meanwhile."""

import json
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from command_runs.processes import Fleet, fleet_in, trigpoint_process
from fleet_runs.driving import Rows, again_until, small_campus_drives, vehicles_on_the_road
from fleet_runs.footprint import Footprint, watched
from fleet_runs.killing import pid_of
from fleet_runs.running import FOLLOWERS
from landmark_databases.cluster import Cluster
from trigpoint.events.observed import VehicleDescribed

SERVICES = ("router", "ingest", *FOLLOWERS)
VEHICLES = 10
LOOKS = 360  # at the processes, in the time of a soak
SOAKED = """
[optimisation.live]
pose_limit = {poses}
solve_interval_s = 60.0
solver_niceness = 0
[up]
services = {services}
[database]
url = {url}
password_file = {password_file}
"""
POSES = 2000  # in the live graph, which begins anew beyond: every few minutes, as it does in hours by itself


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


def never(times: int) -> bool:
    """No number of times is enough."""
    return False


def loaded(fleet: Fleet, drives: Sequence[Rows], services: Sequence[str], load: Load) -> Loaded:
    """A fleet under load, stopped in order afterwards; every event that was sent is acknowledged."""
    fleets = [again_until(driven_by(drives[n % len(drives)], f"veh-{n}"), never) for n in range(load.vehicles)]
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


def soaked(folder: Path, cluster: Cluster, *, duration_s: float) -> Mapping[str, Sequence[Footprint]]:
    """What each process of a fleet with a PostgreSQL server held while ten vehicles drove through the same streets
    again and again. Its live graph is small, so that whatever is there beyond its bound is what grows."""
    values = {
        "services": list(SERVICES),
        "url": cluster.url(cluster.created()),
        "password_file": str(cluster.password_file),
    }
    toml = SOAKED.format(poses=POSES, **{name: json.dumps(value) for name, value in values.items()})
    load = Load(vehicles=VEHICLES, duration_s=duration_s, interval_s=duration_s / LOOKS)
    return loaded(fleet_in(folder / "fleet", toml), small_campus_drives(folder / "campus"), SERVICES, load).footprints
