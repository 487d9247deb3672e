"""A drive followed from its events as they come: keyframes, the motions between them, what was seen and fixed there."""

import heapq
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.drives import CAMERA, NO_DETECTIONS, NO_FIXES, Drive, ImuSeries, WheelSeries
from trigpoint.events.envelope import Envelope
from trigpoint.events.observed import (
    GnssFixReceived,
    ImuMeasured,
    LandmarksDetected,
    Observed,
    VehicleDescribed,
    WheelPairMeasured,
    WheelSpeedMeasured,
)
from trigpoint.geodesy.poses import transform_points
from trigpoint_optimisation.core.graph import turn_sigmas
from trigpoint_optimisation.core.known_landmark_slam import BEARING_SIGMA_RAD, LN_RANGE_SIGMA
from trigpoint_optimisation.core.live_calibration import Calibrating, Calibration, Motion
from trigpoint_optimisation.core.live_tracks import OpenTracks, Sweep, Track
from trigpoint_optimisation.core.odometry import (
    DeadReckonedPath,
    Motions,
    OdometryCalibration,
    TurnSource,
    keyframe_motions,
    relative_poses,
    turn_source,
)
from trigpoint_optimisation.core.preparation import odometry_noise
from trigpoint_optimisation.core.single_sightings import VEHICLE
from trigpoint_optimisation.core.trajectory import composed
from trigpoint_optimisation.settings import CalibrationPriors, SolveSettings

Floats = NDArray[np.float64]

REORDER_NS = 200_000_000  # an event may arrive this much behind a later one and still be taken in order
STANDING_NS = 1_000_000_000  # a standing vehicle has a keyframe after so long,
STANDING_KEYFRAMES = 3  # and so many in a row: what it sees again and again says nothing new
STILL_M = 1e-3  # per keyframe


@dataclass(frozen=True, slots=True, kw_only=True)
class HungFix:
    """A fix: the base's pose (3,) at its time in its keyframe's frame."""

    sequence: int
    stamp_ns: int
    lat_deg: float
    lon_deg: float
    T_keyframe_base: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Leg:
    """What one drive did from keyframe `keyframe` to the next, and what it saw on the way, hung on the first.

    T_odom_start and T_odom_end (3,): by nominal dead reckoning; `delta` (3,) and `covariance` (3, 3) by the
    calibration learned so far.
    """

    keyframe: int
    start_ns: int
    end_ns: int
    T_odom_start: Floats
    T_odom_end: Floats
    delta: Floats
    covariance: Floats
    path_m: float
    tracks: tuple[Track, ...]
    fixes: tuple[HungFix, ...]


@dataclass(frozen=True, slots=True)
class _Wheel:
    stamp_ns: int
    speed_mps: float
    steering_rad: float
    yaw_rate_radps: float


class LiveDrive:
    """One boot of one vehicle, from its first event on. Its own frame is that of nominal dead reckoning from the
    first wheel message; memory is bounded by what arrives within a keyframe."""

    def __init__(
        self, described: VehicleDescribed, boot_id: str, settings: SolveSettings, *, point_scale: float
    ) -> None:
        self.described, self.boot_id = described, boot_id
        self.tracks = OpenTracks(settings.detections)
        self._settings, self._scale = settings, point_scale
        self._waiting: list[tuple[int, int, Observed]] = []
        self._newest_ns = 0
        self._wheels: list[_Wheel] = []
        self._imu: list[tuple[int, float]] = []
        self._heard: list[tuple[int, int, GnssFixReceived | LandmarksDetected]] = []
        self._due_ns = -1
        self._progress = 0.0
        self._standing = 0
        self._keyframe, self._path_m = 0, 0.0
        self._T_odom_base = np.zeros(3)
        self._calibrating: Calibrating | None = None

    def take(self, row: Envelope[Observed]) -> list[Leg]:
        """The legs that are whole now that one more event is here."""
        heapq.heappush(self._waiting, (row.stamp_ns, row.identity.sequence, row.event))
        self._newest_ns = max(self._newest_ns, row.stamp_ns)
        legs = []
        while self._waiting and self._waiting[0][0] <= self._newest_ns - REORDER_NS:
            legs += self._after(*heapq.heappop(self._waiting))
        return legs

    @property
    def calibration(self) -> Calibration | None:
        """What was learned of the odometry so far, None before the first leg."""
        return self._calibrating.calibration if self._calibrating else None

    def _after(self, stamp_ns: int, sequence: int, event: Observed) -> list[Leg]:
        legs = []
        moves = isinstance(event, WheelSpeedMeasured | WheelPairMeasured | ImuMeasured)
        if moves and 0 <= self._due_ns < stamp_ns:
            legs.append(self._closed(stamp_ns if isinstance(event, ImuMeasured) else None, event))
        if isinstance(event, ImuMeasured):
            self._imu.append((stamp_ns, event.yaw_rate_radps))
        elif isinstance(event, GnssFixReceived | LandmarksDetected):
            if self._wheels:
                self._heard.append((stamp_ns, sequence, event))
        elif isinstance(event, VehicleDescribed):
            self.described = event
        elif isinstance(event, WheelSpeedMeasured | WheelPairMeasured):
            self._rolled(self._wheel(event, stamp_ns))
        return legs

    def _wheel(self, event: WheelSpeedMeasured | WheelPairMeasured, stamp_ns: int) -> _Wheel:
        if isinstance(event, WheelSpeedMeasured):
            return _Wheel(stamp_ns, event.speed_mps, event.steering_rad, event.yaw_rate_radps)
        track_m = self.described.track_m
        yaw_rate = (event.right_mps - event.left_mps) / track_m if track_m > 0.0 else math.nan
        return _Wheel(stamp_ns, 0.5 * (event.left_mps + event.right_mps), math.nan, yaw_rate)

    def _rolled(self, wheel: _Wheel) -> None:
        """One more wheel sample; a keyframe is due there once the vehicle has moved, turned or stood enough."""
        last = self._wheels[-1] if self._wheels else None
        if last is not None and wheel.stamp_ns <= last.stamp_ns:
            return
        self._wheels.append(wheel)
        if last is None:
            return
        odometry = self._settings.odometry
        dt_s = min((wheel.stamp_ns - last.stamp_ns) * 1e-9, odometry.max_gap_s)
        step_m, turn_rad = abs(wheel.speed_mps) * dt_s, abs(self._yaw_rate_radps(wheel)) * dt_s
        self._progress += step_m / odometry.keyframe_m + turn_rad / odometry.keyframe_rad
        since_ns = wheel.stamp_ns - self._wheels[0].stamp_ns
        stood = since_ns >= STANDING_NS and self._standing < STANDING_KEYFRAMES
        if self._due_ns < 0 and (self._progress >= 1.0 or stood or (self._progress > 0.2 and since_ns >= STANDING_NS)):
            self._due_ns = wheel.stamp_ns

    def _yaw_rate_radps(self, wheel: _Wheel) -> float:
        if self._imu:
            return self._imu[-1][1]
        if math.isfinite(wheel.steering_rad) and self.described.wheelbase_m > 0.0:
            return wheel.speed_mps * math.tan(max(min(wheel.steering_rad, 1.2), -1.2)) / self.described.wheelbase_m
        return wheel.yaw_rate_radps if math.isfinite(wheel.yaw_rate_radps) else 0.0

    def _closed(self, imu_ns: int | None, event: Observed) -> Leg:
        """The leg up to the keyframe that is due; the samples after it begin the next."""
        imu = list(self._imu)
        if imu_ns is not None and isinstance(event, ImuMeasured):
            imu.append((imu_ns, event.yaw_rate_radps))
        end = next(index for index, wheel in enumerate(self._wheels) if wheel.stamp_ns == self._due_ns)
        leg = self._leg(self._slice(self._wheels[: end + 1], imu))
        self._wheels = self._wheels[end:]
        before = [index for index, (stamp_ns, _) in enumerate(self._imu) if stamp_ns <= self._due_ns]
        self._imu = self._imu[before[-1] :] if before else self._imu
        self._heard = [row for row in self._heard if row[0] >= self._due_ns]
        self._due_ns, self._progress = -1, 0.0
        return leg

    def _slice(self, wheels: list[_Wheel], imu: list[tuple[int, float]]) -> Drive:
        return Drive(
            vehicle=self.described.vehicle,
            boot_id=self.boot_id,
            described=self.described,
            wheels=WheelSeries(
                stamp_ns=np.array([wheel.stamp_ns for wheel in wheels], dtype=np.int64),
                speed_mps=np.array([wheel.speed_mps for wheel in wheels]),
                steering_rad=np.array([wheel.steering_rad for wheel in wheels]),
                yaw_rate_radps=np.array([wheel.yaw_rate_radps for wheel in wheels]),
            ),
            imu=ImuSeries(
                stamp_ns=np.array([stamp_ns for stamp_ns, _ in imu], dtype=np.int64),
                yaw_rate_radps=np.array([rate for _, rate in imu]),
            ),
            fixes=NO_FIXES,
            detections=NO_DETECTIONS,
        )

    def _leg(self, drive: Drive) -> Leg:
        source, odometry = turn_source(drive), self._settings.odometry
        stamp_ns = drive.wheels.stamp_ns[[0, -1]]
        motions = keyframe_motions(
            drive,
            nominal(int(stamp_ns[0])),
            stamp_ns,
            noise=odometry_noise(source, odometry),
            max_gap_s=odometry.max_gap_s,
        )
        motion = Motion(delta=motions.delta[0], derivative=motions.derivative[0], covariance=motions.covariance[0])
        tracks, fixes = self._hung(motions)
        dt_s = float(stamp_ns[1] - stamp_ns[0]) * 1e-9
        calibration = self._calibrated(motion, tracks, source, dt_s=dt_s)
        start, keyframe = self._T_odom_base, self._keyframe
        self._T_odom_base = composed(start[None, :], motion.delta[None, :])[0]
        self._path_m += float(np.hypot(*motion.delta[:2]))
        self._keyframe += 1
        return Leg(
            keyframe=keyframe,
            start_ns=int(stamp_ns[0]),
            end_ns=int(stamp_ns[1]),
            T_odom_start=start,
            T_odom_end=self._T_odom_base,
            delta=motion.at(calibration.off),
            covariance=calibration.noise_of(motion, dt_s=dt_s),
            path_m=self._path_m,
            tracks=tuple(tracks),
            fixes=tuple(fixes),
        )

    def _calibrated(self, motion: Motion, tracks: list[Track], source: TurnSource, *, dt_s: float) -> Calibration:
        """What is known of the odometry after one more motion."""
        calibrating = self._calibrating = self._calibrating or self._begun(source)
        still = bool(np.hypot(*motion.delta[:2]) < STILL_M) and source is not TurnSource.STEERING
        self._standing = self._standing + 1 if still else 0
        calibrating.take(motion, seen_points(tracks, self._keyframe), dt_s=dt_s, standing=still)
        return calibrating.calibration

    def _begun(self, source: TurnSource) -> Calibrating:
        priors = self._settings.calibration
        off = np.array([self._scale - 1.0, 0.0, 0.0, 0.0])
        sigma_m = self._settings.detections.range_sigma_m
        sigma = calibration_sigmas(source, priors)
        by_imu = source is TurnSource.IMU
        fraction = priors.turn_bias_walk_fraction_imu if by_imu else priors.turn_bias_walk_fraction
        walk = float(sigma[3]) * fraction / math.sqrt(60.0)
        return Calibrating(Calibration(off=off, covariance=np.diag(sigma**2)), sigma_m=sigma_m, bias_walk=walk)

    def _hung(self, motions: Motions) -> tuple[list[Track], list[HungFix]]:
        """The tracks seen and the fixes received between the two keyframes."""
        seen: dict[int, Track] = {}
        fixes = []
        for stamp_ns, sequence, event in self._heard:
            if stamp_ns >= self._due_ns:
                continue
            offset = _offset(motions.path, stamp_ns)
            if isinstance(event, GnssFixReceived):
                fixes.append(
                    HungFix(
                        sequence=sequence,
                        stamp_ns=stamp_ns,
                        lat_deg=event.lat_deg,
                        lon_deg=event.lon_deg,
                        T_keyframe_base=offset,
                    )
                )
            else:
                sweep = self._sweep(event, offset, stamp_ns=stamp_ns, sequence=sequence)
                seen |= {track.number: track for track in self.tracks.take(sweep)}
        return [seen[number] for number in sorted(seen)], fixes

    def _sweep(self, event: LandmarksDetected, offset: Floats, *, stamp_ns: int, sequence: int) -> Sweep:
        most_m = self._settings.detections.max_range_m
        rows = [row for row, each in enumerate(event.detections) if each.kind != VEHICLE and each.range_m <= most_m]
        found = [event.detections[row] for row in rows]
        range_m = np.array([each.range_m for each in found])
        bearing = np.array([each.bearing_rad for each in found]) + self.described.landmark_sensor_yaw_rad
        mount = np.array([self.described.landmark_sensor_x_m, self.described.landmark_sensor_y_m])
        ray = range_m[:, None] * np.column_stack([np.cos(bearing), np.sin(bearing)])
        point_m = transform_points(offset, self._scale * (mount + ray))
        return Sweep(
            stamp_ns=stamp_ns,
            sequence=sequence,
            keyframe=self._keyframe,
            row=tuple(rows),
            point_odom_m=transform_points(self._T_odom_base, point_m),
            point_m=point_m,
            covariance=self._covariances(range_m, bearing + offset[2]),
            kind=tuple(each.kind for each in found),
            signature=tuple(each.signature for each in found),
        )

    def _covariances(self, range_m: Floats, angle_rad: Floats) -> Floats:
        """Covariances (d, 2, 2) of seen points in the keyframe's frame."""
        camera, detections = self.described.landmark_sensor_model == CAMERA, self._settings.detections
        along = (LN_RANGE_SIGMA * range_m) ** 2 if camera else np.full(len(range_m), detections.range_sigma_m**2)
        across = (range_m * (BEARING_SIGMA_RAD if camera else detections.bearing_sigma_rad)) ** 2
        c, s = np.cos(angle_rad), np.sin(angle_rad)
        xy = (along - across) * c * s
        rows = [along * c * c + across * s * s, xy, xy, along * s * s + across * c * c]
        return np.stack(rows, axis=-1).reshape(-1, 2, 2)


def nominal(stamp_ns: int) -> OdometryCalibration:
    """The calibration a vehicle's own dead reckoning has: the wheels and the turn source are taken at their word."""
    none = np.zeros(1)
    knots = np.array([stamp_ns], dtype=np.int64)
    return OdometryCalibration(speed_scale=1.0, turn_scale=1.0, delay_s=0.0, bias_stamp_ns=knots, turn_bias=none)


def calibration_sigmas(source: TurnSource, priors: CalibrationPriors) -> Floats:
    """1-sigma (4,) of speed scale, turn scale, delay (held) and turn bias before anything is learned."""
    speed = {
        TurnSource.COMMAND: priors.speed_scale_command,
        TurnSource.SAMPLED_WHEELS: priors.speed_scale_sampled,
    }.get(source, priors.speed_scale)
    scale, bias = turn_sigmas(source, priors)
    return np.array([speed, scale, 0.0, bias])


def seen_points(tracks: list[Track], keyframe: int) -> dict[int, Floats]:
    """Where each track was seen from a keyframe (2,), by track number, averaged."""
    by_track = {track.number: [each.point_m for each in track.seen if each.keyframe == keyframe] for track in tracks}
    return {number: np.mean(points, axis=0) for number, points in by_track.items() if points}


def _offset(path: DeadReckonedPath, stamp_ns: int) -> Floats:
    """The base's pose (3,) at a stamp in the frame of the path's first keyframe."""
    at = path.at(np.array([path.stamp_ns[0], stamp_ns]))
    offset: Floats = relative_poses(at[:1], at[1:])[0]
    return offset
