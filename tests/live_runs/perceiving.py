"""A drive with nothing but a lidar, wheels, a gyroscope and a receiver, appended as fast as it was driven."""

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from itertools import takewhile
from pathlib import Path
from typing import cast

import numpy as np

from live_runs.campus_drives import accepted_fixes
from live_runs.visibility import NO_WHOLE_SOLVES, pinned_by
from trigpoint.bus.memory_bus import MemoryBus
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.mapped import LandmarkSolved
from trigpoint.events.observed import GnssFixReceived, LandmarksDetected, MapFramePinned, Observed
from trigpoint.events.perceived import LandmarksPerceived
from trigpoint.events.scanned import PointsScanned
from trigpoint.geodesy.projection import map_points_from_wgs84
from trigpoint.logs.mcap_log import McapLog
from trigpoint.observability.metrics import Instruments
from trigpoint.observability.running import Service
from trigpoint_optimisation.app import STREAM as MAP_STREAM
from trigpoint_optimisation.core.live_fleet import HUNG, PASSED_OVER
from trigpoint_optimisation.live import LiveOptimisation
from trigpoint_optimisation.whole_solve import SolverInPlace
from trigpoint_perception.app import STREAM
from trigpoint_perception.live import LivePerception
from trigpoint_vehicle.core.campus import Campus, simulate_campus
from trigpoint_vehicle.core.campus_settings import CampusSettings
from trigpoint_vehicle.core.lidar.scanned_campus import ScannedCampus, scanned_campus
from trigpoint_vehicle.core.lidar_settings import CarriedLidar

STEP_S = 0.1  # appended together
WARM_UP_SWEEPS = 10  # machine code is loaded
CATCH_UP_S = 30.0  # at most, for what is left in the end
Rows = Sequence[Envelope[Observed]]


@dataclass(frozen=True, slots=True, kw_only=True)
class PerceivedLive:
    """How long after a sweep was in the log its landmarks were (95th percentile, most), what one took to perceive on
    average, the 99th percentile of the map's updates meanwhile, its landmarks, and the median of their errors; which
    part of the sweeps came after their leg was whole, and which was passed over."""

    said_p95_s: float
    said_most_s: float
    sweep_s: float
    update_p99_ms: float
    landmarks: int
    off_m: float
    late_share: float
    passed_over_share: float


@dataclass(slots=True)
class _Heard:
    """Durations by the name of the work, and when sweeps were appended and said, by sequence."""

    durations: dict[str, list[float]] = field(default_factory=dict)
    appended_s: dict[int, float] = field(default_factory=dict)
    said_s: dict[int, float] = field(default_factory=dict)

    def __call__(self, name: str, seconds: float) -> None:
        self.durations.setdefault(name, []).append(seconds)


def perceived_live(folder: Path, *, seconds: float, seed: int = 1) -> PerceivedLive:
    """The beginning of a campus drive, perceived and mapped while it is appended."""
    settings = CampusSettings(vehicles=1)
    scanned = scanned_campus(simulate_campus(seed, settings), settings, CarriedLidar(), seed=seed)
    rows, heard = _measured(scanned, seconds), _Heard()
    with closing(McapLog(folder / "log")) as log:
        _begin(log, scanned.campus, rows)
        with _at_work(log, heard) as counted:
            _append_in_time(log, rows, heard)
        landmarks = [row.envelope.event for row in log.read(MAP_STREAM, kinds=(LandmarkSolved,))]
    late = _late_sweeps(counted, rows[0].identity.source)
    newest = {event.landmark: event for event in landmarks if isinstance(event, LandmarkSolved)}
    late_s = [said_s - heard.appended_s[sweep] for sweep, said_s in heard.said_s.items()][WARM_UP_SWEEPS:]
    return PerceivedLive(
        said_p95_s=float(np.percentile(late_s, 95)),
        said_most_s=max(late_s),
        sweep_s=float(np.mean(heard.durations["sweep"][WARM_UP_SWEEPS:])),
        update_p99_ms=1e3 * float(np.percentile(heard.durations["update"], 99)),
        landmarks=len(newest),
        off_m=_off_m(scanned, list(newest.values())),
        late_share=(late[HUNG] + late[PASSED_OVER]) / len(heard.said_s),
        passed_over_share=late[PASSED_OVER] / len(heard.said_s),
    )


def _late_sweeps(counted: Instruments, vehicle: str) -> dict[str, float]:
    """How many sweeps were perceived late, by outcome."""
    of = counted.registry.get_sample_value
    name = "trigpoint_late_sweeps_total"
    return {one: of(name, {"vehicle": vehicle, "outcome": one}) or 0.0 for one in (HUNG, PASSED_OVER)}


def _measured(scanned: ScannedCampus, seconds: float) -> Rows:
    """The drive's first seconds without what a landmark sensor would have detected."""
    every = scanned.recordings[0].rows
    until_ns = every[0].stamp_ns + round(seconds * 1e9)
    return [row for row in takewhile(lambda row: row.stamp_ns < until_ns, every) if not _is_detection(row)]


def _is_detection(row: Envelope[Observed]) -> bool:
    return isinstance(row.event, LandmarksDetected)


def _begin(log: McapLog, campus: Campus, rows: Rows) -> None:
    """The frame, and the filter's word on the fixes to come."""
    log.append(STREAM_PATTERNS[MapFramePinned], [pinned_by(campus)])
    fixes = [row.identity for row in rows if isinstance(row.event, GnssFixReceived)]
    verdicts = [
        replace(verdict, boot_id=fix.boot_id, fix_sequence=fix.sequence)
        for verdict, fix in zip(accepted_fixes(campus, 0), fixes, strict=False)
    ]
    log.append("filtering", [Envelope(EventIdentity("filtering", "run", n), 0, one) for n, one in enumerate(verdicts)])


@contextmanager
def _at_work(log: McapLog, heard: _Heard) -> Iterator[Instruments]:
    """Perception and optimisation, each in a thread of its own; what the latter counts."""
    counted = Instruments("optimisation", heard=heard)
    perceiving = LivePerception(log, MemoryBus(), instruments=Instruments("perception", heard=heard))
    optimising = LiveOptimisation(
        log,
        SolverInPlace(log, NO_WHOLE_SOLVES),
        settings=NO_WHOLE_SOLVES,
        instruments=counted,
    )
    stop, services = threading.Event(), cast(list[Service], [perceiving, optimising])
    threads = [threading.Thread(target=one.run, args=(stop,)) for one in services]
    for thread in threads:
        thread.start()
    try:
        yield counted
    finally:
        stop.set()
        for thread, service in zip(threads, services, strict=True):
            thread.join()
            service.close()


def _append_in_time(log: McapLog, rows: Rows, heard: _Heard) -> None:
    stream = STREAM_PATTERNS[PointsScanned].format(vehicle=rows[0].identity.source)
    stamps, pause = np.array([row.stamp_ns for row in rows]), threading.Event()
    began_s, at, seen, step = time.monotonic(), 0, 0, 0
    while at < len(rows) or (step * STEP_S < (stamps[-1] - stamps[0]) * 1e-9 + CATCH_UP_S and _lags(heard)):
        step += 1
        pause.wait(max(0.0, began_s + step * STEP_S - time.monotonic()))
        end = int(np.searchsorted(stamps, stamps[0] + step * STEP_S * 1e9))
        if end > at:
            log.append(stream, cast(Sequence[Envelope[Event]], rows[at:end]))
            sweeps = [row.identity.sequence for row in rows[at:end] if isinstance(row.event, PointsScanned)]
            heard.appended_s.update(dict.fromkeys(sweeps, time.monotonic()))
        at, seen = end, _note_said(log, seen, heard)


def _lags(heard: _Heard) -> bool:
    """Whether more wait than those that wait for what would come after the end."""
    return len(heard.said_s) < len(heard.appended_s) - 5


def _note_said(log: McapLog, seen: int, heard: _Heard) -> int:
    """The number up to which perception's stream has been looked at now."""
    for row in log.read(STREAM, first_number=seen):
        seen = row.position.number + 1
        if isinstance(row.envelope.event, LandmarksPerceived):
            heard.said_s[row.envelope.event.sweep_sequence] = time.monotonic()
    return seen


def _off_m(scanned: ScannedCampus, landmarks: Sequence[LandmarkSolved]) -> float:
    """The median distance of landmarks to the nearest true one."""
    true = scanned.truth.landmarks
    lat, lon = (np.array([getattr(one, name) for one in true]) for name in ("lat_deg", "lon_deg"))
    true_m = map_points_from_wgs84(lat, lon, scanned.campus.frame)
    return float(np.median([np.hypot(*(true_m - one.position_m).T).min() for one in landmarks] or [np.nan]))
