"""The drives that are under way and the map they grow: a fold over their events, begun anew from each whole solve."""

from collections import Counter, deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.envelope import Envelope
from trigpoint.events.estimated import FixJudged
from trigpoint.events.mapped import LandmarkSolved, OdometryCorrected, TrajectorySolved
from trigpoint.events.observed import Observed, VehicleDescribed
from trigpoint.events.perceived import LandmarksPerceived
from trigpoint.geodesy.poses import wrap_angle_rad
from trigpoint.geodesy.projection import MapFrame
from trigpoint_optimisation.core.live_drive import LiveDrive
from trigpoint_optimisation.core.live_leg import Leg
from trigpoint_optimisation.core.live_map import WAITING_M, LiveMap
from trigpoint_optimisation.core.live_placing import Placed, map_from_odom
from trigpoint_optimisation.core.live_state import DriveName, DrivePlace
from trigpoint_optimisation.core.trajectory import composed
from trigpoint_optimisation.settings import SolveSettings

Floats = NDArray[np.float64]

LEGS_MOST = 3  # led into the map in one update: hundreds wait once it begins anew
HUNG, PASSED_OVER = "hung on its leg", "passed over"  # what becomes of a sweep perceived late
LOOSENED = 4.0  # of a start's covariance: what it shares with the landmarks is not to be counted twice


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Where a drive was at a stamp: T_map_base (3,), or T_map_odom (3,) where that is known; covariance (3, 3)."""

    stamp_ns: int
    T_map_base: Floats | None = None
    T_map_odom: Floats | None = None
    covariance: Floats


def corrected_start(stamp_ns: int, event: OdometryCorrected) -> Start:
    """A start from the newest correction that was sent."""
    return Start(stamp_ns=stamp_ns, T_map_odom=event.T_map_odom, covariance=event.covariance)


def solved_start(path: TrajectorySolved) -> Start:
    """A start from the end of a solved path."""
    return Start(stamp_ns=int(path.stamp_ns[-1]), T_map_base=path.pose[-1], covariance=path.covariance[-1])


@dataclass(slots=True)
class _Followed:
    """One drive: what makes its legs, those that may be needed again and of them those not in the map yet, its
    start."""

    drive: LiveDrive
    legs: list[Leg] = field(default_factory=list)
    behind: deque[Leg] = field(default_factory=deque)
    start: Start | None = None


class LiveFleet:
    """Drives and map; `starts` are the places of drives that were under way before."""

    def __init__(
        self,
        frame: MapFrame,
        settings: SolveSettings,
        *,
        base: Sequence[LandmarkSolved] = (),
        starts: Mapping[DriveName, Start] | None = None,
        excluded: Iterable[DriveName] = (),
    ) -> None:
        self._frame, self._settings = frame, settings
        self._followed: dict[DriveName, _Followed] = {}
        self._accepted: dict[DriveName, set[int]] = {}  # fixes, by the filter
        self._starts = dict(starts or {})
        self._late: Counter[tuple[str, str]] = Counter()
        self.excluded = frozenset(excluded)
        self.map = LiveMap(frame, settings, base=base)

    def take(self, row: Envelope[Observed]) -> list[DrivePlace]:
        """Where the drive came to, if the event brought it to a new keyframe and it has a place."""
        name = (row.identity.source, row.identity.boot_id)
        followed = self._followed.get(name) or self._begun(name, row.event)
        return self._led(name, followed, followed.drive.take(row))

    def _led(self, name: DriveName, followed: _Followed, legs: Sequence[Leg]) -> list[DrivePlace]:
        places = []
        for leg in legs:
            followed.legs.append(leg)
            followed.behind.append(leg)
            places += self._lead_on(name, followed)
            if not self.map.is_placed(name) and followed.start is None:
                followed.legs = _still_needed(followed.legs, None)
        return places

    def perceive(self, row: Envelope[LandmarksPerceived]) -> list[DrivePlace]:
        """The same as `take`, of what was perceived in a sweep of a drive that has begun."""
        name = (row.event.vehicle, row.event.boot_id)
        followed = self._followed[name]
        passed_over = followed.drive.passed_over
        places = self._led(name, followed, followed.drive.perceive(row))
        self._late[name[0], PASSED_OVER] += followed.drive.passed_over - passed_over
        for late in followed.drive.seen_late():
            self._late[name[0], HUNG if self._look_again(name, followed, late.leg) else PASSED_OVER] += late.sweeps
        return places

    def _look_again(self, name: DriveName, followed: _Followed, leg: Leg) -> bool:
        """Whether a leg of which more was seen comes into the map, or is there and looked at again."""
        comes = bool(followed.behind) and leg.keyframe >= followed.behind[0].keyframe
        return comes or self.map.look_again(name, leg)

    def take_late(self) -> Mapping[tuple[str, str], int]:
        """How many sweeps were perceived after their legs were whole, by vehicle and outcome, since this was asked
        last."""
        late, self._late = self._late, Counter()
        return +late

    def described(self, name: DriveName) -> VehicleDescribed | None:
        """What a drive's vehicle is; None before its first event."""
        followed = self._followed.get(name)
        return None if followed is None else followed.drive.described

    @property
    def ahead(self) -> int:
        """How many perceived sweeps wait for their drives' measurements."""
        return sum(followed.drive.ahead for followed in self._followed.values())

    def catch_up(self) -> tuple[bool, list[DrivePlace]]:
        """A little of what waits, of one drive: whether anything did, and where the drive came to."""
        for name, followed in self._followed.items():
            if followed.behind:
                return True, self._lead_on(name, followed)
        return self.map.catch_up(), []

    def judged(self, verdict: FixJudged) -> None:
        """The filter's verdict on a fix; only accepted ones hold."""
        name = (verdict.vehicle, verdict.boot_id)
        if not verdict.accepted:
            return
        self._accepted.setdefault(name, set()).add(verdict.fix_sequence)  # it may be here before its fix is
        self.map.judged(name, verdict.fix_sequence)

    def begin_anew(
        self,
        landmarks: Sequence[LandmarkSolved],
        trajectories: Sequence[TrajectorySolved],
        *,
        excluded: Iterable[DriveName],
    ) -> None:
        """The map begun anew from a whole solve; what came since waits to be caught up with."""
        self.map = LiveMap(self._frame, self._settings, base=landmarks)
        self.excluded = frozenset(excluded)
        starts = {(path.vehicle, path.boot_id): solved_start(path) for path in trajectories if len(path.stamp_ns)}
        going_on = {name[0]: name for name in self._followed}  # a vehicle's newest boot
        ended = [n for n in self._followed if n in starts and going_on[n[0]] != n]
        for name in ended:
            del self._followed[name]
            self._accepted.pop(name, None)
        for name, followed in self._followed.items():
            followed.start = starts.get(name)
            followed.legs = _still_needed(followed.legs, followed.start)
            followed.behind = deque(followed.legs)
            for track in (track for leg in followed.legs for track in leg.tracks.values()):
                track.begin_anew()

    def _begun(self, name: DriveName, event: Observed) -> _Followed:
        described = event if isinstance(event, VehicleDescribed) else VehicleDescribed(vehicle=name[0])
        drive = LiveDrive(described, name[1], self._settings, point_scale=self._frame.point_scale)
        followed = self._followed[name] = _Followed(drive, start=self._starts.pop(name, None))
        return followed

    def _lead_on(self, name: DriveName, followed: _Followed) -> list[DrivePlace]:
        """The drive's oldest legs that wait, so few that an update stays short; where they bring it."""
        places: list[DrivePlace] = []
        for _ in range(min(LEGS_MOST, len(followed.behind))):
            places = self._lead(name, followed, followed.behind.popleft()) or places
        return places

    def _lead(self, name: DriveName, followed: _Followed, leg: Leg) -> list[DrivePlace]:
        """One leg into the map; legs before the drive's start are in the map's base already."""
        if name in self.excluded:
            return []
        described = followed.drive.described
        if followed.start is not None:
            if leg.end_ns < followed.start.stamp_ns:
                return []
            self.map.begin(described, name[1], placed=_placed(followed.start, leg))
            followed.start = None
            return []
        if not self.map.knows(name):
            self.map.begin(described, name[1])
        places = self.map.take(name, leg)
        for fix in leg.fixes:
            if fix.sequence in self._accepted.get(name, ()):
                self.map.judged(name, fix.sequence)
        return places


def _still_needed(legs: Sequence[Leg], start: Start | None) -> list[Leg]:
    """The legs that end after a start, and those a drive without one finds its place by."""
    if not legs:
        return []
    recent = [leg for leg in legs if leg.path_m > legs[-1].path_m - WAITING_M]
    if start is None:
        return recent
    return [leg for leg in legs if leg.end_ns >= start.stamp_ns] or recent[-1:]


def _placed(start: Start, leg: Leg) -> Placed:
    """The keyframe at the end of the first leg that reaches a start's stamp."""
    T_map_odom = start.T_map_odom
    if T_map_odom is None:
        assert start.T_map_base is not None, "one of the two is known"
        T_map_odom = map_from_odom(start.T_map_base, _odom_at(leg, start.stamp_ns))
    pose = composed(T_map_odom[None, :], leg.T_odom_end[None, :])[0]
    pose[2] = wrap_angle_rad(float(pose[2]))
    return Placed(keyframe=leg.keyframe + 1, pose=pose, covariance=LOOSENED * start.covariance + 1e-9 * np.eye(3))


def _odom_at(leg: Leg, stamp_ns: int) -> Floats:
    share = float(np.clip((stamp_ns - leg.start_ns) / max(leg.end_ns - leg.start_ns, 1), 0.0, 1.0))
    between: Floats = leg.T_odom_start + share * (leg.T_odom_end - leg.T_odom_start)
    return between
