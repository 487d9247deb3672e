"""A drive's sweeps taken one after the other: deskewed, searched, matched, tracked, and told as events."""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import EventRejected
from trigpoint.events.perceived import LandmarksPerceived, OdometryMatched, PerceivedLandmark, SweepPerceived
from trigpoint.events.scanned import PointsScanned
from trigpoint_perception.core.deskew import NS_PER_S, Path, deskewed, deskewed_by_velocity, poses_at
from trigpoint_perception.core.odometry import (
    LidarOdometry,
    Match,
    relative_pose,
)
from trigpoint_perception.core.perceiving import sights_of
from trigpoint_perception.core.planar import planar_pose
from trigpoint_perception.core.sweep import Sweep, usable_sweep
from trigpoint_perception.core.tracks import Sight, Track, Tracks, class_of, followed
from trigpoint_perception.core.velocity import expected_motion, velocity_of
from trigpoint_perception.settings import PerceptionSettings

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class NumberedSweep:
    """A sweep as the log has it: its sequence in the vehicle's boot, and its stamp."""

    sequence: int
    stamp_ns: int
    scanned: PointsScanned


@dataclass(frozen=True, slots=True)
class _Waiting:
    """A sweep that waits for the ones after it to confirm what was seen in it."""

    numbered: NumberedSweep
    refusal: str = ""
    sights: tuple[Sight, ...] = ()
    tracks: tuple[int, ...] = ()
    odometry: OdometryMatched | None = None


@dataclass(frozen=True, slots=True)
class _Placed:
    """The last sweep that was matched, and where the base was at the middle of its points' times (4, 4)."""

    sequence: int
    stamp_ns: int
    match: Match
    middle_ns: int
    T_odom_middle: Floats


class SweepFollower:
    """Follows one sensor of one drive. The same sweeps give the same events; each sweep one LandmarksPerceived."""

    def __init__(self, vehicle: str, boot_id: str, settings: PerceptionSettings, *, wheels: Path | None = None) -> None:
        """`wheels`: the base's path by dead reckoning, where there is one; else motion is taken to go on as it was."""
        self._vehicle, self._boot_id, self._settings, self._wheels = vehicle, boot_id, settings, wheels
        self._odometry = LidarOdometry(settings.odometry)
        self._tracks = Tracks()
        self._last: _Placed | None = None
        self._velocity: Floats | None = None
        self._begun: tuple[NumberedSweep, Sweep] | None = None  # the first sweep, until a velocity is known
        self._waiting: deque[_Waiting] = deque()
        self._number = 0  # of the sweep, refused ones too
        self.restarts = 0  # where the clock jumped or sweeps were missing

    @property
    def last_stamp_ns(self) -> int | None:
        """The stamp of the last sweep that was matched, None before the first one and after a jump of the clock."""
        return None if self._last is None else self._last.stamp_ns

    def lead_by(self, wheels: Path | None) -> None:
        """From now on the base moves by this path, None: as it moved before."""
        self._wheels = wheels

    def take(self, numbered: NumberedSweep) -> tuple[tuple[int, SweepPerceived], ...]:
        """Events with their stamps that are certain after one more sweep, those of earlier sweeps first."""
        restarted: tuple[tuple[int, SweepPerceived], ...] = ()
        self._number += 1
        if self._is_apart(numbered.stamp_ns):
            restarted = self._restarted()
        try:
            self._waiting.append(self._seen(numbered))
        except EventRejected as error:
            self._waiting.append(_Waiting(numbered, str(error)))
        ready = len(self._waiting) - self._settings.track.window + 1
        return (*restarted, *(each for _ in range(ready) for each in self._told(self._waiting.popleft())))

    def finished(self) -> tuple[tuple[int, SweepPerceived], ...]:
        """The events of the sweeps that still waited."""
        told = tuple(each for waiting in self._waiting for each in self._told(waiting))
        self._waiting.clear()
        return told

    def _is_apart(self, stamp_ns: int) -> bool:
        """Whether a stamp is not shortly after the last sweep's: the clock jumped, or sweeps are missing."""
        if self._last is None:
            return False
        gap_s = (stamp_ns - self._last.stamp_ns) / NS_PER_S
        return not 0.0 < gap_s <= self._settings.odometry.gap_max_s

    def _restarted(self) -> tuple[tuple[int, SweepPerceived], ...]:
        told = self.finished()
        self._odometry = LidarOdometry(self._settings.odometry)
        self._tracks = Tracks(next_number=self._tracks.next_number)
        self._last, self._begun = None, None
        self.restarts += 1
        return told

    def _seen(self, numbered: NumberedSweep) -> _Waiting:
        """One sweep searched, matched and tracked. Raises EventRejected where it is not usable."""
        usable = usable_sweep(numbered.scanned, self._settings.sweep)
        sweep, placed = self._matched(numbered, usable)
        if self._begun is not None and self._velocity is not None:
            self._begin_again(self._begun)
            sweep, placed = self._matched(numbered, usable)
        if self._last is None and self._velocity is None and not self._is_covered(usable, numbered.stamp_ns):
            self._begun = numbered, usable
        sights = sights_of(sweep, self._settings)
        odometry = self._odometry_event(numbered, placed.match)
        self._last = placed
        self._tracks, numbers = followed(
            self._tracks,
            sights,
            planar_pose(placed.match.T_odom_base),
            sweep=self._number,
            settings=self._settings.track,
        )
        return _Waiting(numbered, "", sights, numbers, odometry)

    def _matched(self, numbered: NumberedSweep, usable: Sweep) -> tuple[Sweep, _Placed]:
        sweep = self._still(usable, numbered.stamp_ns)
        match = self._odometry.matched(sweep.point_m, self._expected(numbered.stamp_ns))
        return sweep, self._placed(numbered, sweep, match)

    def _begin_again(self, begun: tuple[NumberedSweep, Sweep]) -> None:
        """The map begun anew by its first sweep, now that a velocity is known to deskew it by."""
        self._begun, self._last = None, None
        self._odometry = LidarOdometry(self._settings.odometry)
        _, self._last = self._matched(*begun)

    def _still(self, sweep: Sweep, stamp_ns: int) -> Sweep:
        """The sweep as if the base had stood at its stamp, as well as its motion is known beforehand."""
        if not sweep.offset_ns.any():
            return sweep
        if self._wheels is not None and self._is_covered(sweep, stamp_ns):
            still_m = deskewed(sweep.point_m, sweep.offset_ns, stamp_ns=stamp_ns, path=self._wheels)
        elif self._velocity is not None:
            still_m = deskewed_by_velocity(sweep.point_m, sweep.offset_ns, self._velocity)
        else:
            return sweep
        return replace(sweep, point_m=still_m)

    def _is_covered(self, sweep: Sweep, stamp_ns: int) -> bool:
        wheels = self._wheels
        first_ns, last_ns = stamp_ns + int(sweep.offset_ns.min()), stamp_ns + int(sweep.offset_ns.max())
        return wheels is not None and int(wheels.stamp_ns[0]) <= first_ns and last_ns <= int(wheels.stamp_ns[-1])

    def _expected(self, stamp_ns: int) -> Floats:
        """Where the base is expected (4, 4): moved on by the wheels, or as it moved before."""
        last = self._last
        if last is None:
            return np.eye(4)
        wheels = self._wheels
        if wheels is not None and wheels.stamp_ns[0] <= last.stamp_ns and stamp_ns <= wheels.stamp_ns[-1]:
            position_m, rotation = poses_at(wheels, np.array([last.stamp_ns, stamp_ns], dtype=np.int64))
            motion = np.eye(4)
            motion[:3, :3] = rotation[0].T @ rotation[1]
            motion[:3, 3] = rotation[0].T @ (position_m[1] - position_m[0])
        else:
            motion = self._motion((stamp_ns - last.stamp_ns) / NS_PER_S)
        expected: Floats = last.match.T_odom_base @ motion
        return expected

    def _placed(self, numbered: NumberedSweep, sweep: Sweep, match: Match) -> _Placed:
        """Where the base was, and the velocity it had by then.

        Where no wheels say how it moved during the sweep, what is sure is its place at the middle of the points'
        times: a wrong velocity moves the points before it as far as those after. Velocity is taken between middles and
        carries the place back to the stamp; taken between stamps, an error would come back in the next one, larger.
        """
        stamp_ns, last = numbered.stamp_ns, self._last
        if match.refusal or self._is_covered(sweep, stamp_ns):
            middle_ns, T_odom_middle = stamp_ns, match.T_odom_base
        else:
            middle_ns = stamp_ns + int(sweep.offset_ns.mean())
            T_odom_middle = match.T_odom_base @ self._motion((middle_ns - stamp_ns) / NS_PER_S)
        if last is not None and not match.refusal and middle_ns > last.middle_ns:
            motion = np.linalg.inv(last.T_odom_middle) @ T_odom_middle
            self._velocity = velocity_of(motion, (middle_ns - last.middle_ns) / NS_PER_S)
            if middle_ns != stamp_ns:
                at_stamp = T_odom_middle @ self._motion((stamp_ns - middle_ns) / NS_PER_S)
                match = replace(match, T_odom_base=at_stamp)
        return _Placed(numbered.sequence, stamp_ns, match, middle_ns, T_odom_middle)

    def _motion(self, dt_s: float) -> Floats:
        """The motion (4, 4) over so long at the velocity last known; none where none is."""
        return np.eye(4) if self._velocity is None else expected_motion(self._velocity, dt_s)

    def _odometry_event(self, numbered: NumberedSweep, match: Match) -> OdometryMatched | None:
        last = self._last
        if last is None or match.refusal or last.match.refusal:
            return None
        motion, covariance = relative_pose(last.match, match, self._settings.odometry)
        return OdometryMatched(
            vehicle=self._vehicle,
            boot_id=self._boot_id,
            sensor=numbered.scanned.sensor,
            from_sequence=last.sequence,
            from_stamp_ns=last.stamp_ns,
            sweep_sequence=numbered.sequence,
            x_m=float(motion[0]),
            y_m=float(motion[1]),
            heading_rad=float(motion[2]),
            covariance=covariance,
            matched_share=match.matched_share,
        )

    def _told(self, waiting: _Waiting) -> tuple[tuple[int, SweepPerceived], ...]:
        counting = {track.number: track for track in self._tracks.tracks if track.confirmed}
        landmarks = tuple(
            _landmark(sight, counting[number])
            for sight, number in zip(waiting.sights, waiting.tracks, strict=True)
            if number in counting
        )
        perceived = LandmarksPerceived(
            vehicle=self._vehicle,
            boot_id=self._boot_id,
            sensor=waiting.numbered.scanned.sensor,
            sweep_sequence=waiting.numbered.sequence,
            refusal=waiting.refusal,
            landmarks=landmarks,
        )
        stamp_ns = waiting.numbered.stamp_ns
        motion = () if waiting.odometry is None else ((stamp_ns, waiting.odometry),)
        return (*motion, (stamp_ns, perceived))


def _landmark(sight: Sight, track: Track) -> PerceivedLandmark:
    return PerceivedLandmark(
        kind=sight.kind,
        landmark_class=class_of(track),
        track=track.number,
        x_m=float(sight.position_m[0]),
        y_m=float(sight.position_m[1]),
        variance_x_m2=float(sight.covariance_m2[0, 0]),
        covariance_xy_m2=float(sight.covariance_m2[0, 1]),
        variance_y_m2=float(sight.covariance_m2[1, 1]),
        height_m=sight.height_m,
        diameter_m=sight.diameter_m,
        points=sight.points,
    )
