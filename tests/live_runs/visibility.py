"""From a sweep in the log to its landmark in the database: a drive appended as fast as it was driven."""

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import cast

import numpy as np

from live_runs.campus_drives import accepted_fixes
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.observed import MapFramePinned, VehicleDescribed
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint.landmarks.model import Checkpoint, MapChange
from trigpoint.logs.mcap_log import McapLog
from trigpoint.observability.running import Service
from trigpoint_landmarks.live import LandmarkProjection
from trigpoint_optimisation.live import LiveOptimisation
from trigpoint_optimisation.settings import LiveSettings, SolveSettings
from trigpoint_optimisation.whole_solve import SolverInPlace
from trigpoint_vehicle.core.campus import Campus, simulate_campus
from trigpoint_vehicle.core.campus_settings import CampusSettings

STEP_S = 0.1  # appended together
WARM_UP_S = 100.0  # taken in at once: the drive has found its place then
CATCHING_UP_S = 20.0  # the warm-up is taken in by then
NO_WHOLE_SOLVES = SolveSettings(live=LiveSettings(settle_s=1e9, solve_interval_s=1e9, correction_delay_s=1e9))


@dataclass(frozen=True, slots=True, kw_only=True)
class Visible:
    """How long after its newest sweep was in the log a landmark was there: rows, 95th percentile, most."""

    rows: int
    p95_s: float
    most_s: float


@dataclass(slots=True)
class Times:
    """When the log had everything up to a stamp, and when a landmark's first row was committed, by its newest sweep."""

    appended: list[tuple[int, float]] = field(default_factory=list)
    committed: dict[str, tuple[int, float]] = field(default_factory=dict)


class TimedStore(GeoPackageStore):
    """A landmark database that notes when rows were committed."""

    def __init__(self, path: Path, times: Times) -> None:
        super().__init__(path)
        self._times = times

    def apply_all(self, changes: Sequence[MapChange], checkpoint: Checkpoint) -> None:
        super().apply_all(changes, checkpoint)
        now_s = time.monotonic()
        for row in (row for change in changes for row in change.opened):
            self._times.committed.setdefault(row.landmark, (row.last_seen_ns, now_s))


def visible_within(folder: Path, *, seconds: float, seed: int = 1) -> Visible:
    """A vehicle's drive into an empty map: the warm-up at once, then `seconds` of it in their own time."""
    campus, times = simulate_campus(seed, CampusSettings(vehicles=1)), Times()
    log = McapLog(folder / "log")
    log.append(STREAM_PATTERNS[MapFramePinned], [pinned_by(campus)])
    judged = [cast(Event, verdict) for verdict in accepted_fixes(campus, 0)]
    verdicts = [Envelope(EventIdentity("filtering", "run", n), 0, event) for n, event in enumerate(judged)]
    log.append("filtering", verdicts)
    optimising = LiveOptimisation(log, SolverInPlace(log, NO_WHOLE_SOLVES), settings=NO_WHOLE_SOLVES)
    projecting = LandmarkProjection(log, lambda: TimedStore(folder / "landmarks.gpkg", times))
    stop = threading.Event()
    threads = [threading.Thread(target=one.run, args=(stop,)) for one in cast(list[Service], [optimising, projecting])]
    for thread in threads:
        thread.start()
    try:
        _append_in_time(log, campus, times, seconds=seconds)
        stop.wait(3.0)
    finally:
        stop.set()
        for thread in threads:
            thread.join()
        optimising.close()
        projecting.close()
        log.close()
    return _visible(times)


def pinned_by(campus: Campus) -> Envelope[Event]:
    """The frame of a campus."""
    frame = campus.frame
    event = MapFramePinned(
        crs=frame.crs,
        origin_easting_m=frame.origin_easting_m,
        origin_northing_m=frame.origin_northing_m,
        declared_by="campus",
    )
    return Envelope(EventIdentity("ingest", "frame", 0), 0, event)


def _append_in_time(log: McapLog, campus: Campus, times: Times, *, seconds: float) -> None:
    rows = cast(Sequence[Envelope[Event]], campus.recordings[0].rows)
    stream = STREAM_PATTERNS[VehicleDescribed].format(vehicle=campus.recordings[0].vehicle)
    stamps = np.array([row.stamp_ns for row in rows])
    at = int(np.searchsorted(stamps, stamps[0] + WARM_UP_S * 1e9))
    log.append(stream, rows[:at])
    began_s, first_ns = time.monotonic() + CATCHING_UP_S, int(stamps[at])
    time.sleep(CATCHING_UP_S)
    for step in range(1, round(seconds / STEP_S) + 1):
        time.sleep(max(0.0, began_s + step * STEP_S - time.monotonic()))
        end = int(np.searchsorted(stamps, first_ns + step * STEP_S * 1e9))
        if end > at:
            log.append(stream, rows[at:end])
            times.appended.append((int(stamps[end - 1]), time.monotonic()))
        at = end


def _visible(times: Times) -> Visible:
    """Of every landmark that became one after the warm-up; a row changed later says nothing of a sweep."""
    stamps = np.array([stamp for stamp, _ in times.appended])
    took_s = [
        committed_s - times.appended[int(np.searchsorted(stamps, seen_ns))][1]
        for seen_ns, committed_s in times.committed.values()
        if stamps[0] < seen_ns <= stamps[-1]
    ]
    if not took_s:
        return Visible(rows=0, p95_s=float("nan"), most_s=float("nan"))
    return Visible(rows=len(took_s), p95_s=float(np.percentile(took_s, 95)), most_s=max(took_s))
