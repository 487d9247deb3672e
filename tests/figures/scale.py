"""Perception by Dask workers: how much sooner two are done than one."""

import time
from functools import cache, partial
from pathlib import Path

from dask_clusters.cluster import running_workers
from figures.figure import Figure, Measurement, at_least
from figures.workbench import Workbench
from scanned_worlds.drives import scanned_drive
from trigpoint.logs.mcap_log import McapLog
from trigpoint.workers import workers
from trigpoint_perception.app import perceive_log

DRIVES, SWEEPS = 6, 80
COMMAND = f"trigpoint perceive --cluster tcp://…  # {DRIVES} drives of {SWEEPS} sweeps of 16 beams"


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


FIGURES = (Figure(name="two Dask workers over one, perception", unit="x", target=at_least(1.7), measure=of_workers),)
