"""The campus's simulated lidar: how long a drive of 2 km takes, points cast and written."""

import time
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

from figures.figure import Bounds, Figure, Measurement, at_most
from figures.workbench import Workbench
from trigpoint_vehicle.app import casting_ahead, write_conversion
from trigpoint_vehicle.core.campus import simulate_campus
from trigpoint_vehicle.core.campus_settings import CampusSettings, RouteSettings
from trigpoint_vehicle.core.lidar.scanned_campus import conversion_with_points, scanned_campus
from trigpoint_vehicle.core.lidar_settings import CarriedLidar

SEED = 1
# No loop through the quadrangle is shorter; the drive is a little over 2 km.
DRIVE = CampusSettings(vehicles=1, route=RouteSettings(length_min_m=1950.0, length_max_m=2400.0, coverage_min=0.2))
COMMAND = f"trigpoint demo --lidar --vehicles 1 --seed {SEED}  # its simulation alone, on a loop of 2 to 2.4 km"


@dataclass(frozen=True, slots=True, kw_only=True)
class Driven:
    """What one drive took: wall and processor time from the world's making to the log on disk, and what is in it."""

    wall_s: float
    processor_s: float
    drive_s: float
    sweeps: int
    log_mb: float


@cache
def driven(folder: Path) -> Driven:
    """The drive cast and written once, after a few sweeps that get the machine code ready."""
    campus = simulate_campus(SEED, DRIVE)
    scanned_campus(campus, DRIVE, CarriedLidar(), seed=SEED).scans[0].events(0, 2)
    began_s, busy_s = time.perf_counter(), time.process_time()
    with casting_ahead() as casting:
        scanned = scanned_campus(campus, DRIVE, CarriedLidar(), seed=SEED, casting=casting)
        written = write_conversion(conversion_with_points(scanned), folder / "lidar-campus")
    return Driven(
        wall_s=time.perf_counter() - began_s,
        processor_s=time.process_time() - busy_s,
        drive_s=float(campus.motions[0].time_s[-1]),
        sweeps=len(scanned.scans[0]),
        log_mb=written.logs[0].stat().st_size / 1e6,
    )


def of_drive(bench: Workbench, *, name: str) -> Measurement:
    """A number of the drive."""
    return Measurement(value=float(getattr(driven(bench.folder), name)), command=COMMAND)


def _figure(name: str, unit: str, target: Bounds | None, value: str) -> Figure:
    return Figure(name=name, unit=unit, target=target, measure=partial(of_drive, name=value))


FIGURES = (
    _figure("campus drive of 2 km with a 16-beam lidar, simulated and written", "s", at_most(120.0), "wall_s"),
    _figure("the same, processor time", "s", None, "processor_s"),
    _figure("the same, duration of the drive", "s", None, "drive_s"),
    _figure("the same, sweeps", "1", None, "sweeps"),
    _figure("the same, log on disk", "MB", None, "log_mb"),
)
