"""Perception and rendering by Dask workers: how much sooner two are done than one."""

import shutil
import time
from functools import cache, partial
from pathlib import Path

from dask_clusters.cluster import running_workers
from figures.figure import Figure, Measurement, at_least
from figures.workbench import Workbench
from replayed_fleets.replaying import record_drive, replayed_log
from scanned_worlds.drives import scanned_drive
from trigpoint.logs.mcap_log import McapLog
from trigpoint.workers import workers
from trigpoint_perception.app import perceive_log
from trigpoint_tiles.app import PMTILES, render_ortho
from trigpoint_tiles.hands import Hands

DRIVES, SWEEPS = 6, 80
RENDERED_DRIVES, RENDERED_SWEEPS = 6, 100
COMMAND = f"trigpoint perceive --cluster tcp://…  # {DRIVES} drives of {SWEEPS} sweeps of 16 beams"
RENDERING_COMMAND = f"trigpoint ortho render --cluster tcp://…  # {RENDERED_DRIVES} drives of {RENDERED_SWEEPS} sweeps"


def drives_in(folder: Path) -> Path:
    """A log of vehicles with a lidar, not perceived yet."""
    log = McapLog(folder)
    for number in range(DRIVES):
        vehicle = f"veh-{number}"
        log.append(f"veh-{vehicle}", list(scanned_drive(vehicle, SWEEPS)))
    log.close()
    return folder


def seconds(folder: Path, address: str) -> float:
    """How long perceiving the drives takes."""
    log = McapLog(drives_in(folder))
    began_s = time.perf_counter()
    with workers(address) as some:
        reports = perceive_log(log, partial(McapLog, folder), some=some)
    took_s = time.perf_counter() - began_s
    log.close()
    assert [report.sweeps for report in reports] == [SWEEPS] * DRIVES, reports
    return took_s


@cache
def ratio(folder: Path) -> float:
    """The time of one worker over that of two, each after a run that made them ready."""
    took_s = {}
    for count in (1, 2):
        with running_workers(folder / f"cluster-{count}", count) as address:
            seconds(folder / f"ready-{count}", address)
            took_s[count] = seconds(folder / f"timed-{count}", address)
    return took_s[1] / took_s[2]


def of_workers(bench: Workbench) -> Measurement:
    """The ratio."""
    return Measurement(value=ratio(bench.folder / "scale"), command=COMMAND)


def rendering_seconds(folder: Path, address: str) -> float:
    """How long rendering a fleet's web tiles takes."""
    opened = partial(replayed_log, folder / "log", RENDERED_DRIVES, RENDERED_SWEEPS)
    out = folder / "out"
    began_s = time.perf_counter()
    with opened() as log, workers(address) as some:
        render_ortho(log, out, formats=(PMTILES,), hands=Hands(some, opened))
    took_s = time.perf_counter() - began_s
    shutil.rmtree(out)
    return took_s


@cache
def rendering_ratio(folder: Path) -> float:
    """The time of one worker over that of two, each after a run that made them ready."""
    record_drive(folder / "log", RENDERED_SWEEPS)
    took_s = {}
    for count in (1, 2):
        with running_workers(folder / f"cluster-{count}", count) as address:
            rendering_seconds(folder, address)
            took_s[count] = rendering_seconds(folder, address)
    return took_s[1] / took_s[2]


def of_rendering(bench: Workbench) -> Measurement:
    """The ratio."""
    return Measurement(value=rendering_ratio(bench.folder / "rendering"), command=RENDERING_COMMAND)


FIGURES = (
    Figure(name="two Dask workers over one, perception", unit="x", target=at_least(1.7), measure=of_workers),
    Figure(name="two Dask workers over one, rendering", unit="x", target=at_least(1.7), measure=of_rendering),
)
