"""The simulated campus driven into the live map: update times, and a vehicle without a receiver against its truth."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trigpoint.events.drives import drives_of
from trigpoint.events.envelope import Envelope
from trigpoint.events.estimated import FixJudged
from trigpoint.events.mapped import LandmarkSolved
from trigpoint.events.observed import GnssFixReceived, Observed
from trigpoint.events.solved import SolvedMap
from trigpoint.geodesy.projection import map_points_from_wgs84
from trigpoint_optimisation.core.live_fleet import LiveFleet
from trigpoint_optimisation.core.live_state import DrivePlace
from trigpoint_optimisation.core.solve import solve_map
from trigpoint_optimisation.settings import SolveSettings
from trigpoint_vehicle.core.campus import Campus, simulate_campus
from trigpoint_vehicle.core.campus_settings import CampusSettings

GOOD_FIX_M = 6.0  # the filter's part here: fixes nearer to the truth than this are accepted
Rows = Sequence[Envelope[Observed]]


@dataclass(frozen=True, slots=True, kw_only=True)
class UpdateTimes:
    """99th percentiles of the updates from so many poses in the map on (of the newest whole map's paths and of the
    growing graph): by the clock, and of the processor; how many poses the map had in the end and the growing graph at
    most, and how often the whole map was solved."""

    poses: int
    growing_most: int
    solves: int
    p99_ms: float
    p99_processor_ms: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Placed:
    """A vehicle's errors in m once it has a place, when that was, and how its covariance holds (1: as it says)."""

    mean_m: float
    worst_m: float
    after_s: float
    nees: float


def accepted_fixes(campus: Campus, index: int) -> list[FixJudged]:
    """A verdict for every fix of a vehicle: accepted where it is near the truth."""
    rows, true = campus.recordings[index].rows, campus.truth.fixes[index]
    fixes = [row for row in rows if isinstance(row.event, GnssFixReceived)]
    lat, lon = (np.array([getattr(row.event, name) for row in fixes]) for name in ("lat_deg", "lon_deg"))
    off = map_points_from_wgs84(lat, lon, campus.frame) - map_points_from_wgs84(
        true.lat_deg, true.lon_deg, campus.frame
    )
    return [
        FixJudged(
            vehicle=row.identity.source,
            boot_id=row.identity.boot_id,
            fix_sequence=row.identity.sequence,
            accepted=bool(near),
            reason="inside gate" if near else "outside gate",
            nis=math.nan,
            limit=math.nan,
            innovation_x_m=math.nan,
            innovation_y_m=math.nan,
        )
        for row, near in zip(fixes, np.hypot(*off.T) < GOOD_FIX_M, strict=True)
    ]


def update_times(*, vehicles: int, poses: int, seed: int = 1) -> UpdateTimes:
    """How long updates take once the map has `poses`, drive after drive.

    As in the service the whole map is solved when the growing graph is beyond its limit, and taken in once that solve
    would be done: after as much time of the drive as it took.
    """
    campus = simulate_campus(seed, CampusSettings(vehicles=vehicles))
    solving = WholeSolves(campus, SolveSettings())
    fleet = LiveFleet(campus.frame, SolveSettings())
    wall, processor = [], []
    most = 0  # poses of the growing graph
    for index, recording in enumerate(campus.recordings):
        verdicts = {verdict.fix_sequence: verdict for verdict in accepted_fixes(campus, index)}
        for count, row in enumerate(recording.rows, start=1):
            began_s, began_processor_s = time.perf_counter(), time.thread_time()
            places = fleet.take(row)
            if row.identity.sequence in verdicts:
                fleet.judged(verdicts[row.identity.sequence])
            if places and solving.pose_count + fleet.map.pose_count >= poses:
                wall.append(time.perf_counter() - began_s)
                processor.append(time.thread_time() - began_processor_s)
            most = max(most, fleet.map.pose_count)
            if places:
                solving.look(fleet, drive=index, rows=count, stamp_ns=row.stamp_ns)
    p99_ms, p99_processor_ms = (
        1e3 * float(np.percentile(each, 99)) if each else math.nan for each in (wall, processor)
    )
    return UpdateTimes(
        poses=solving.pose_count + fleet.map.pose_count,
        growing_most=most,
        solves=solving.count,
        p99_ms=p99_ms,
        p99_processor_ms=p99_processor_ms,
    )


class WholeSolves:
    """Whole solves as the service asks for them, each taken in when it would be done."""

    def __init__(self, campus: Campus, settings: SolveSettings) -> None:
        self._campus, self._settings = campus, settings
        self._solved: SolvedMap | None = None
        self._due_ns = 0
        self.pose_count = self.count = 0  # of the newest whole map; of the solves taken in

    def look(self, fleet: LiveFleet, *, drive: int, rows: int, stamp_ns: int) -> None:
        """A solve begun of what came so far, `rows` of this drive's, or the one under way taken in if it is due."""
        if self._solved is not None and stamp_ns >= self._due_ns:
            solved, self._solved = self._solved, None
            self.count += 1
            self.pose_count = sum(len(path.stamp_ns) for path in solved.trajectories)
            fleet.begin_anew(solved.landmarks, solved.trajectories, excluded=())
        elif self._solved is None and fleet.map.pose_count > self._settings.live.pose_limit:
            began_s = time.perf_counter()
            self._solved = self._whole(drive, rows)
            self._due_ns = stamp_ns + round((time.perf_counter() - began_s) * 1e9)

    def _whole(self, drive: int, rows: int) -> SolvedMap:
        recordings = self._campus.recordings
        so_far = [row for one in recordings[:drive] for row in one.rows] + list(recordings[drive].rows[:rows])
        verdicts = [one for index in range(drive + 1) for one in accepted_fixes(self._campus, index)]
        return solve_map(drives_of(so_far), (), self._campus.frame, self._settings, verdicts=verdicts).map


def solved_base(campus: Campus, index: int) -> tuple[LandmarkSolved, ...]:
    """The anchored map of one vehicle's drive alone."""
    drives = drives_of(campus.recordings[index].rows)
    verdicts = accepted_fixes(campus, index)
    return solve_map(drives, campus.anchors, campus.frame, SolveSettings(), verdicts=verdicts).map.landmarks


def without_receiver(*, seed: int = 1, seconds: float = math.inf) -> Placed:
    """A vehicle without a receiver in the anchored map of another, against its truth."""
    campus = simulate_campus(seed, CampusSettings(vehicles=2))
    fleet = LiveFleet(campus.frame, SolveSettings(), base=solved_base(campus, 0))
    rows: Rows = campus.recordings[1].rows
    until_ns = rows[0].stamp_ns + min(seconds, 1e9) * 1e9
    heard = [row for row in rows if not isinstance(row.event, GnssFixReceived) and row.stamp_ns <= until_ns]
    places = [place for row in heard for place in fleet.take(row)]
    return _against_truth(campus, places, rows[0].stamp_ns)


def _against_truth(campus: Campus, places: Sequence[DrivePlace], first_ns: int) -> Placed:
    (path,) = (path for path in campus.truth.paths if path.vehicle == campus.recordings[1].vehicle)
    true_m = map_points_from_wgs84(path.lat_deg, path.lon_deg, campus.frame)
    at = [place.stamp_ns for place in places]
    off = np.array([place.T_map_base[:2] for place in places])
    off -= np.column_stack([np.interp(at, path.stamp_ns, true_m[:, axis]) for axis in (0, 1)])
    spread = [place.covariance[:2, :2] for place in places]
    nees = np.mean([one @ np.linalg.solve(cov, one) / 2.0 for one, cov in zip(off, spread, strict=True)])
    error_m = np.hypot(*off.T)
    return Placed(
        mean_m=float(error_m.mean()),
        worst_m=float(error_m.max()),
        after_s=(at[0] - first_ns) * 1e-9,
        nees=float(nees),
    )
