"""A fleet's services run on what its log holds, until they have taken in all of it."""

from collections.abc import Sequence
from contextlib import AbstractContextManager, closing, suppress
from pathlib import Path

from command_runs.processes import Fleet, Process, fleet_in, trigpoint_process, wait_until
from trigpoint.events.mapped import MapSolved
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.readings import MAPPED_STREAM
from trigpoint_optimisation.app import input_positions

FOLLOWERS = ("filtering", "optimisation", "landmarks")  # in the order events go through them
SETTLE_S = 900.0  # for a service to take in all there is, beside eight other jobs
LIVE = "[optimisation.live]\nsettle_s = 1.0\nsolver_niceness = 0\n"
QUICK = LIVE + "[up]\nservices = {services}\nbackoff_first_s = 0.05\nbackoff_ceiling_s = 0.2\n"
LAG = "trigpoint_projection_lag_events"


def fleet_of(folder: Path, followers: Sequence[str] = FOLLOWERS, *, toml: str = "") -> Fleet:
    """A fleet whose services start again at once."""
    services = ["router", "ingest", *followers]
    return fleet_in(folder, QUICK.format(services=str(services).replace("'", '"')) + toml)


def alone(fleet: Fleet, name: str) -> AbstractContextManager[Process]:
    """One service running on what the log holds, with nobody on its bus."""
    quiet = ("--set", "bus.mode=peer", "--set", "bus.connect=[]")
    return trigpoint_process(fleet.folder, "serve", name, "--config", fleet.config, *quiet)


def settle(fleet: Fleet, followers: Sequence[str] = FOLLOWERS) -> None:
    """Every service has taken in all there is, one after the other."""
    for name in followers:
        catch_up(fleet, name)


def catch_up(fleet: Fleet, name: str) -> None:
    """One service run until it has taken in all there is."""
    with alone(fleet, name) as process:
        wait_until(
            lambda: process.popen.poll() is not None or has_caught_up(fleet, name),
            f"{name} caught up",
            within_s=SETTLE_S,
        )
        assert process.stop() == 0, process.err


def has_caught_up(fleet: Fleet, name: str) -> bool:
    """Whether a service is ready and nothing waits for it; optimisation has solved the whole map of it as well."""
    if not fleet.is_ready(name) or metric(fleet, name, LAG) != 0.0:
        return False
    return name != "optimisation" or is_whole_map_solved(fleet)


def is_whole_map_solved(fleet: Fleet) -> bool:
    """Whether the newest map version was solved as a whole from everything there is."""
    with closing(McapLog(fleet.data / "log")) as log:
        heads = [row.envelope.event for row in log.read(MAPPED_STREAM, kinds=(MapSolved,))]
        newest = heads[-1] if heads else None
        return isinstance(newest, MapSolved) and not newest.base_version and newest.inputs == input_positions(log)


def metric(fleet: Fleet, name: str, sample: str) -> float | None:
    """The value of a sample, by its name with labels; None where it is not told."""
    for line in fleet.page(name, "/metrics")[1].splitlines():
        with suppress(ValueError):
            if line.startswith(f"{sample} "):
                return float(line.rpartition(" ")[2])
    return None
