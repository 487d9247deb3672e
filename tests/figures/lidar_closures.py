"""Loops closed by landmark constellations and points, on a campus that two vehicles drive on, often the other way."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np

from figures.figure import Bounds, Figure, Measurement, at_least, at_most
from figures.workbench import Workbench
from looped_worlds.judging import JudgedLoops, judged_loops
from looped_worlds.without_landmarks import Solve, solve_without_landmarks
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.readings import logged_drives, logged_frame
from trigpoint.workers import workers
from trigpoint_ingest.recorded import ingest_logs
from trigpoint_perception.app import perceive_log
from trigpoint_perception.closing import LoopReport, close_loops
from trigpoint_vehicle.app import casting_ahead, write_conversion
from trigpoint_vehicle.core.campus import simulate_campus
from trigpoint_vehicle.core.campus_settings import CampusSettings, RouteSettings
from trigpoint_vehicle.core.lidar.scanned_campus import conversion_with_points, scanned_campus
from trigpoint_vehicle.core.lidar_settings import CarriedLidar

SEED = 3
WRONG_SHARE = 0.3
# Of its 4.9 km some 0.9 km are driven again by the same vehicle the other way, 0.9 km by the other the same way, and
# 1.8 km by the other the other way.
DRIVES = CampusSettings(vehicles=2, route=RouteSettings(length_min_m=1950.0, length_max_m=2800.0, coverage_min=0.2))
COMMAND = f"trigpoint perceive  # campus {SEED}, two vehicles on loops of 2 to 2.8 km, points only"


@dataclass(frozen=True, slots=True, kw_only=True)
class Closed:
    """What was closed: the drives' reports, loops against the truth, and processor time over the drives' duration; and
    the drives solved for without landmarks: without loops, with them, and with some of these wrong."""

    reports: tuple[LoopReport, ...]
    judged: JudgedLoops
    time_share: float
    apart: Solve
    together: Solve
    misled: Solve

    @property
    def proposed(self) -> int:
        """Places that landmarks proposed."""
        return sum(report.proposed for report in self.reports)

    @property
    def verified(self) -> int:
        """Those that points verified."""
        return sum(report.verified for report in self.reports)


@cache
def closed(folder: Path) -> Closed:
    """The campus driven, perceived, and its loops closed."""
    campus = simulate_campus(SEED, DRIVES)
    with casting_ahead() as casting:
        scanned = scanned_campus(campus, DRIVES, CarriedLidar(), seed=SEED, casting=casting)
        written = write_conversion(conversion_with_points(scanned), folder / "vehicles")
    assert written.truth is not None, "a simulated campus has truth"
    log, open_log = McapLog(folder / "log"), partial(McapLog, folder / "log")
    try:
        ingest_logs(written.logs, log)
        with workers(threads=1) as some:
            perceive_log(log, open_log, some=some)
            began_s = time.process_time()
            reports = close_loops(log, open_log, some=some)
            took_s = time.process_time() - began_s
        judged, drives = judged_loops(log, written.truth), logged_drives(log)
        solve = partial(solve_without_landmarks, drives, logged_frame(log), written.truth)
    finally:
        log.close()
    driven_s = sum(float(motion.time_s[-1]) for motion in campus.motions)
    return Closed(
        reports=reports,
        judged=judged,
        time_share=took_s / driven_s,
        apart=solve(with_loops=False),
        together=solve(with_loops=True),
        misled=solve(with_loops=True, wrong_share=WRONG_SHARE),
    )


def of_loops(bench: Workbench, *, value: Callable[[Closed], float]) -> Measurement:
    """A number of the closed loops."""
    return Measurement(value=float(value(closed(bench.folder / "closures"))), command=COMMAND)


def _figure(name: str, unit: str, target: Bounds | None, value: Callable[[Closed], float]) -> Figure:
    return Figure(name=name, unit=unit, target=target, measure=partial(of_loops, value=value))


FIGURES = (
    _figure("campus, places proposed by landmarks", "1", None, lambda found: found.proposed),
    _figure("campus, loops verified by points", "1", at_least(50.0), lambda found: found.verified),
    _figure(
        "campus, loops wrong (off by over 0.5 m or 2 degrees)", "1", at_most(0.0), lambda found: found.judged.wrong
    ),
    _figure("campus, error of loops, mean", "m", None, lambda found: found.judged.error_m.mean()),
    _figure("campus, error of loops, p95", "m", None, lambda found: np.quantile(found.judged.error_m, 0.95)),
    _figure("campus, error of loops, largest", "m", None, lambda found: found.judged.error_m.max()),
    _figure("campus, loops, NEES over 3", "1", at_most(1.5), lambda found: found.judged.nees.mean() / 3.0),
    _figure("without landmarks, no loops: one drive off the other", "m", None, lambda found: found.apart.apart_m),
    _figure("without landmarks, no loops: error of the paths", "m", None, lambda found: found.apart.path_m),
    _figure("with half the loops, off at the other half", "m", at_most(0.2), lambda found: found.together.apart_m),
    _figure("with half the loops, error of the paths", "m", None, lambda found: found.together.path_m),
    _figure("30 % of the loops wrong, off at the other half", "m", at_most(0.2), lambda found: found.misled.apart_m),
    _figure(
        "30 % of the loops wrong, error of the paths over that with right ones",
        "1",
        at_most(1.1),
        lambda found: found.misled.path_m / found.together.path_m,
    ),
    _figure("campus, loops: processor time over the drives'", "1", at_most(0.5), lambda found: found.time_share),
)
