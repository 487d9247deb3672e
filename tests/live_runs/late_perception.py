"""The simulated campus driven into the live map by what perception would say of its sweeps, some of it late: how long
each update takes."""

import math
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np

from live_runs.campus_drives import WholeSolves, accepted_fixes
from solved_worlds.perceived import by_perception
from trigpoint.events.envelope import Envelope
from trigpoint.events.observed import LandmarksDetected, Observed, VehicleDescribed
from trigpoint.events.perceived import LandmarksPerceived
from trigpoint_optimisation.core.live_fleet import HUNG, PASSED_OVER, LiveFleet
from trigpoint_optimisation.core.live_state import DrivePlace
from trigpoint_optimisation.settings import SolveSettings
from trigpoint_vehicle.core.campus import simulate_campus
from trigpoint_vehicle.core.campus_settings import CampusSettings

USUAL_NS = 700_000_000  # after a sweep: the five of a track's window, and the work
SPEED = 2.5  # of perception: sweeps perceived while one is measured
PAUSE_EVERY_NS, PAUSE_NS = 120_000_000_000, 20_000_000_000  # it stands still: started anew, or without a processor
SWEEP_NS = 100_000_000  # from one to the next
ALL = "all"
Rows = Sequence[Envelope[Observed]]


@dataclass(frozen=True, slots=True, kw_only=True)
class PerceivedUpdateTimes:
    """Of the updates once the map has so many poses: 99th percentile by the clock, the processor's part, and that of
    those that came while perception was catching up; which part of all sweeps was perceived after its leg was whole,
    and which was passed over."""

    p99_ms: float
    p99_processor_ms: float
    late_p99_ms: float
    late_share: float
    passed_over_share: float
    poses: int


@dataclass(slots=True)
class _Updates:
    """Each update's seconds, those of the processor, and whether sweeps came late since the one before; sweeps by
    outcome; whether any came late since the last update."""

    wall_s: list[float] = field(default_factory=list)
    processor_s: list[float] = field(default_factory=list)
    late: list[bool] = field(default_factory=list)
    sweeps: Counter[str] = field(default_factory=Counter)
    came_late: bool = False

    def of(self, fleet: LiveFleet, row: Envelope[Any], *, timed: bool) -> list[DrivePlace]:
        """One more event taken; where that brought its drive."""
        began_s, began_processor_s = time.perf_counter(), time.thread_time()
        is_perceived = isinstance(row.event, LandmarksPerceived)
        places = fleet.perceive(row) if is_perceived else fleet.take(row)
        took = time.perf_counter() - began_s, time.thread_time() - began_processor_s
        for (_, outcome), count in fleet.take_late().items():
            self.sweeps[outcome] += count
            self.came_late = True
        self.sweeps[ALL] += is_perceived
        if places and timed:
            self.wall_s.append(took[0])
            self.processor_s.append(took[1])
            self.late.append(self.came_late)
        self.came_late = self.came_late and not places
        return places


def perceived_update_times(*, vehicles: int, poses: int, seed: int = 1) -> PerceivedUpdateTimes:
    """How long updates take, drive after drive, where perception pauses for 20 s in every two minutes.

    What vehicles detect is told as perception's; whole solves, taken in as in `update_times`, are of the detections.
    """
    campus = simulate_campus(seed, CampusSettings(vehicles=vehicles))
    solving, updates = WholeSolves(campus, SolveSettings()), _Updates()
    fleet = LiveFleet(campus.frame, SolveSettings())
    for index, recording in enumerate(campus.recordings):
        verdicts = {verdict.fix_sequence: verdict for verdict in accepted_fixes(campus, index)}
        for count, row in as_perceived(recording.rows):
            places = updates.of(fleet, row, timed=solving.pose_count + fleet.map.pose_count >= poses)
            if isinstance(row.event, LandmarksPerceived):
                continue
            if row.identity.sequence in verdicts:
                fleet.judged(verdicts[row.identity.sequence])
            if places:
                solving.look(fleet, drive=index, rows=count, stamp_ns=row.stamp_ns)
    return PerceivedUpdateTimes(
        p99_ms=_p99_ms(updates.wall_s),
        p99_processor_ms=_p99_ms(updates.processor_s),
        late_p99_ms=_p99_ms([took for took, late in zip(updates.wall_s, updates.late, strict=True) if late]),
        late_share=(updates.sweeps[HUNG] + updates.sweeps[PASSED_OVER]) / updates.sweeps[ALL],
        passed_over_share=updates.sweeps[PASSED_OVER] / updates.sweeps[ALL],
        poses=solving.pose_count + fleet.map.pose_count,
    )


def as_perceived(rows: Rows) -> list[tuple[int, Envelope[Any]]]:
    """A drive's events as they come, each after so many rows of it were measured, its detections as perception's."""
    described = next(row.event for row in rows if isinstance(row.event, VehicleDescribed))
    due: list[tuple[int, int, Envelope[Any]]] = []
    free_ns = rows[0].stamp_ns
    for count, row in enumerate(rows, start=1):
        if isinstance(row.event, LandmarksDetected):
            free_ns = _perceived_ns(row.stamp_ns, free_ns, since_ns=rows[0].stamp_ns)
            told = by_perception(cast(Envelope[Any], row), described, count)
            due.append((max(free_ns, row.stamp_ns + USUAL_NS), count, told))
        else:
            due.append((row.stamp_ns, count, row))
    return [(count, row) for _, count, row in sorted(due, key=lambda each: each[:2])]


def _perceived_ns(stamp_ns: int, free_ns: int, *, since_ns: int) -> int:
    """When a sweep is perceived by who is free from a time on."""
    began_ns = max(stamp_ns, free_ns)
    into_ns = (began_ns - since_ns) % PAUSE_EVERY_NS
    waits_ns = max(0, into_ns - (PAUSE_EVERY_NS - PAUSE_NS))
    return began_ns + (PAUSE_NS - waits_ns if waits_ns else 0) + round(SWEEP_NS / SPEED)


def _p99_ms(seconds: Sequence[float]) -> float:
    return 1e3 * float(np.percentile(seconds, 99)) if seconds else math.nan
