"""A whole drive filtered: the online fold run over its series in order of time."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import FrameRefused
from trigpoint.events.drives import Drive
from trigpoint.events.estimated import FixJudged, GateAlarmed
from trigpoint.geodesy.poses import wrap_angles_rad
from trigpoint.geodesy.positions import MapPosition
from trigpoint.geodesy.projection import MapFrame, map_points_from_wgs84
from trigpoint_filtering.core.estimator import Belief, pose_covariances
from trigpoint_filtering.core.following import Track, base_speed_mps, started_track
from trigpoint_filtering.core.motion import ANTENNA_X, ANTENNA_Y, HEADING, SPEED_SCALE, STATE_SIZE, X
from trigpoint_filtering.core.odometer import Odometer, after_imu_sample, after_wheel_sample
from trigpoint_filtering.core.online import after_fix, is_step_due, with_odometer
from trigpoint_filtering.settings import FilterSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """The filter's last word on the odometry: mean and sigma (5,) of speed scale, turn scale, turn bias
    (rad/s for an IMU, rad for steering, rad/m for wheels), antenna x, y in m; NaN if it never had a position."""

    mean: Floats
    sigma: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class FilteredDrive:
    """What the filter made of a drive.

    stamp_ns (n,) strictly rising; pose (n, 3): `T_map_base` x, y in m, heading in rad; covariance (n, 3, 3)
    of it; speed_mps (n,) of the base; antenna_m (n, 2): the antenna as the filter believes it, in m in the
    base frame. `judged` holds one verdict a fix, in the order of the drive's fixes; `alarms` at
    `alarm_stamp_ns`. `refusal` says why there are no poses, empty where there are.
    """

    vehicle: str
    boot_id: str
    stamp_ns: Ints
    pose: Floats
    covariance: Floats
    speed_mps: Floats
    antenna_m: Floats
    judged: tuple[FixJudged, ...]
    alarms: tuple[GateAlarmed, ...]
    alarm_stamp_ns: Ints
    calibration: Calibration
    refusal: str


Progress = Callable[[int, int], None]  # samples taken, of how many


def filter_drive(
    drive: Drive, frame: MapFrame, settings: FilterSettings, *, progress: Progress | None = None
) -> FilteredDrive:
    """A drive filtered causally; without poses and with the reason where position or heading cannot be found."""
    recording = _Recording()
    track = begun_track(drive, frame, settings)
    for track in tracks(drive, frame, settings, progress=progress):
        recording.take(track)
    return recording.filtered(track)


def begun_track(drive: Drive, frame: MapFrame, settings: FilterSettings) -> Track:
    """The track of a drive before its first sample."""
    return started_track(drive.described, boot_id=drive.boot_id, point_scale=frame.point_scale, settings=settings)


def tracks(
    drive: Drive, frame: MapFrame, settings: FilterSettings, *, progress: Progress | None = None
) -> Iterator[Track]:
    """The track of a drive whenever it has taken a step or a fix; nothing for a drive without fixes.

    The same functions as in the online fold; samples between steps are folded into the odometer alone.
    """
    if len(drive.fixes.stamp_ns) == 0:
        return
    track = begun_track(drive, frame, settings)
    odometer = track.odometer
    samples = (_wheel_rows(drive), _imu_rows(drive), _fix_rows(drive, frame))
    kinds = _kinds_in_order(drive)
    for done, kind in enumerate(kinds, start=1):
        row = next(samples[kind])
        if kind == FIXES:
            track = _with_fix(replace(track, odometer=odometer), row)
        else:
            odometer = _with_sample(odometer, kind, row)
            if not is_step_due(track.following, odometer):
                continue
            track = with_odometer(track, odometer)
        odometer = track.odometer
        yield track
        if progress is not None and (kind == FIXES or done == len(kinds)):
            progress(done, len(kinds))


def _with_fix(track: Track, row: tuple[float, ...]) -> Track:
    x_m, y_m, stamp_ns, sigma_m, sequence = row
    position = MapPosition(x_m, y_m)
    return after_fix(track, position, stamp_ns=int(stamp_ns), sigma_m=sigma_m, sequence=int(sequence))


WHEELS, IMU, FIXES = range(3)


def _with_sample(odometer: Odometer, kind: int, row: tuple[float, ...]) -> Odometer:
    if kind == WHEELS:
        stamp_ns, speed_mps, steering_rad, yaw_rate_radps = row
        return after_wheel_sample(
            odometer, speed_mps, steering_rad=steering_rad, yaw_rate_radps=yaw_rate_radps, stamp_ns=int(stamp_ns)
        )
    stamp_ns, yaw_rate_radps = row
    return after_imu_sample(odometer, yaw_rate_radps, stamp_ns=int(stamp_ns))


def _kinds_in_order(drive: Drive) -> list[int]:
    """Which series each sample comes from, sorted by time; at one stamp wheels before IMU before fixes."""
    series = (drive.wheels.stamp_ns, drive.imu.stamp_ns, drive.fixes.stamp_ns)
    kind = np.repeat([WHEELS, IMU, FIXES], [len(stamps) for stamps in series])
    ordered: list[int] = kind[np.lexsort((kind, np.concatenate(series)))].tolist()
    return ordered


def _rows(*columns: Floats | Ints) -> Iterator[tuple[float, ...]]:
    return zip(*(column.tolist() for column in columns), strict=True)


def _wheel_rows(drive: Drive) -> Iterator[tuple[float, ...]]:
    wheels = drive.wheels
    return _rows(wheels.stamp_ns, wheels.speed_mps, wheels.steering_rad, wheels.yaw_rate_radps)


def _imu_rows(drive: Drive) -> Iterator[tuple[float, ...]]:
    return _rows(drive.imu.stamp_ns, drive.imu.yaw_rate_radps)


def _fix_rows(drive: Drive, frame: MapFrame) -> Iterator[tuple[float, ...]]:
    fixes = drive.fixes
    point_m = _placed_points(fixes.lat_deg, fixes.lon_deg, frame)
    return _rows(point_m[:, 0], point_m[:, 1], fixes.stamp_ns, fixes.sigma_m, fixes.sequence)


def _placed_points(lat_deg: Floats, lon_deg: Floats, frame: MapFrame) -> Floats:
    """Fixes (n, 2) in the map frame; NaN where the projection does not reach, which no gate lets pass."""
    try:
        return map_points_from_wgs84(lat_deg, lon_deg, frame)
    except FrameRefused:
        if len(lat_deg) == 1:
            return np.full((1, 2), np.nan)
        half = len(lat_deg) // 2
        parts = (slice(None, half), slice(half, None))
        return np.concatenate([_placed_points(lat_deg[part], lon_deg[part], frame) for part in parts])


@dataclass(slots=True)
class _Recording:
    """What a track brought, gathered as it goes; several beliefs at one stamp count as the last of them."""

    stamp_ns: list[int] = field(default_factory=list)
    mean: list[Floats] = field(default_factory=list)
    covariance: list[Floats] = field(default_factory=list)
    speed_mps: list[float] = field(default_factory=list)
    judged: list[FixJudged] = field(default_factory=list)
    alarms: list[GateAlarmed] = field(default_factory=list)
    alarm_stamp_ns: list[int] = field(default_factory=list)
    newest: Belief | None = None

    def take(self, track: Track) -> None:
        if track.verdict is not None:
            self.judged.append(track.verdict)
        if track.alarm is not None:
            self.alarms.append(track.alarm)
            self.alarm_stamp_ns.append(track.fix_ns)
        if track.hypothesis is not None and track.hypothesis.belief is not self.newest:
            self._take_belief(track, track.hypothesis.belief)

    def _take_belief(self, track: Track, belief: Belief) -> None:
        self.newest = belief
        if self.stamp_ns and self.stamp_ns[-1] == track.believed_ns:
            for column in (self.stamp_ns, self.mean, self.covariance, self.speed_mps):
                column.pop()
        self.stamp_ns.append(track.believed_ns)
        self.mean.append(belief.mean)
        self.covariance.append(belief.covariance[:SPEED_SCALE, :SPEED_SCALE])
        self.speed_mps.append(base_speed_mps(track))

    def filtered(self, track: Track) -> FilteredDrive:
        mean = np.array(self.mean).reshape(-1, STATE_SIZE)
        pose = mean[:, X:SPEED_SCALE].copy()
        pose[:, HEADING] = wrap_angles_rad(pose[:, HEADING])
        return FilteredDrive(
            vehicle=track.following.vehicle,
            boot_id=track.following.boot_id,
            stamp_ns=np.array(self.stamp_ns, dtype=np.int64),
            pose=pose,
            covariance=pose_covariances(np.array(self.covariance).reshape(-1, 3, 3)),
            speed_mps=np.array(self.speed_mps),
            antenna_m=mean[:, ANTENNA_X : ANTENNA_Y + 1],
            judged=tuple(self.judged),
            alarms=tuple(self.alarms),
            alarm_stamp_ns=np.array(self.alarm_stamp_ns, dtype=np.int64),
            calibration=_calibration(self.newest),
            refusal="" if self.mean else track.refusal,
        )


def _calibration(belief: Belief | None) -> Calibration:
    if belief is None:
        return Calibration(mean=np.full(5, np.nan), sigma=np.full(5, np.nan))
    part = slice(SPEED_SCALE, ANTENNA_Y + 1)
    return Calibration(mean=belief.mean[part], sigma=np.sqrt(belief.covariance.diagonal()[part]))
