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
from trigpoint.events.perceived import LandmarksPerceived
from trigpoint_optimisation.core.graph import turn_sigmas
from trigpoint_optimisation.core.live_calibration import Calibrating, Calibration, Motion
from trigpoint_optimisation.core.live_leg import HungFix, Leg
from trigpoint_optimisation.core.live_past import LateLeg, PastLegs, offset_at
from trigpoint_optimisation.core.live_sweeps import Hook, SweepReading
from trigpoint_optimisation.core.live_tracks import OpenTracks, Track
from trigpoint_optimisation.core.odometry import (
    Motions,
    OdometryCalibration,
    TurnSource,
    keyframe_motions,
    turn_source,
)
from trigpoint_optimisation.core.preparation import odometry_noise
from trigpoint_optimisation.core.trajectory import composed
from trigpoint_optimisation.settings import CalibrationPriors, SolveSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Heard = GnssFixReceived | LandmarksDetected | LandmarksPerceived
Event = Observed | LandmarksPerceived

PERCEIVED_WAIT_NS = 3_000_000_000  # behind the newest measurement legs do not wait longer for what perception finds
AHEAD_NS = 10_000_000_000  # of the newest measurement: what was perceived so far on is of another clock,
AHEAD_SWEEPS = 500  # and more of it than this is not kept
REORDER_NS = 200_000_000  # an event may arrive this much behind a later one and still be taken in order
STANDING_NS = 1_000_000_000  # a standing vehicle has a keyframe after so long,
STANDING_KEYFRAMES = 3  # and so many in a row: what it sees again and again says nothing new
STILL_M = 1e-3  # per keyframe


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
        self._waiting: list[tuple[int, int, Event]] = []
        self._newest_ns = self._perceived_ns = self._released_ns = self._own_ns = -1
        self._perceived: list[tuple[int, int, Event]] = []
        self.passed_over = 0  # perceived sweeps that came too late or too early
        self._past = PastLegs()
        self._wheels: list[_Wheel] = []
        self._imu: list[tuple[int, float]] = []
        self._heard: list[tuple[int, int, Heard]] = []
        self._due_ns = -1
        self._progress = 0.0
        self._standing = 0
        self._keyframe, self._path_m = 0, 0.0
        self._T_odom_base = np.zeros(3)
        self._calibrating: Calibrating | None = None

    def take(self, row: Envelope[Observed]) -> list[Leg]:
        """The legs that are whole now that one more event is here."""
        event = row.event
        if isinstance(event, LandmarksDetected) and self._perceived_ns >= 0:  # both saw the same things
            event = LandmarksDetected(detections=tuple(one for one in event.detections if one.signature))
        elif isinstance(event, LandmarksDetected):
            self._own_ns = max(self._own_ns, row.stamp_ns)
        heapq.heappush(self._waiting, (row.stamp_ns, row.identity.sequence, event))
        self._newest_ns = max(self._newest_ns, row.stamp_ns)
        return self._released()

    def perceive(self, row: Envelope[LandmarksPerceived]) -> list[Leg]:
        """The same, of what was perceived in one more sweep, each once: from the first on, measurements wait for it.

        What the vehicle itself detected without a signature then stands back; a camera does not. What comes after its
        leg was whole is hung on that leg: see `seen_late`.
        """
        if self.described.landmark_sensor_model == CAMERA:
            return []
        self._perceived_ns = max(self._perceived_ns, row.stamp_ns)
        if row.stamp_ns <= self._released_ns:
            self._take_late(row)
        elif len(self._perceived) == AHEAD_SWEEPS:
            self.passed_over += 1
        else:
            self._past.leave()
            heapq.heappush(self._perceived, (row.stamp_ns, row.event.sweep_sequence, row.event))
        return self._released()

    def seen_late(self) -> list[LateLeg]:
        """The legs, whole before, of which more was seen since this was asked last."""
        return self._past.take_seen()

    def _take_late(self, row: Envelope[LandmarksPerceived]) -> None:
        """A sweep hung where it belongs, in the leg under way or one that is whole, unless that is too long ago or has
        what the vehicle itself detected there."""
        stamp_ns, sequence = row.stamp_ns, row.event.sweep_sequence
        if stamp_ns <= self._own_ns:
            self.passed_over += 1
        elif self._wheels and stamp_ns >= self._wheels[0].stamp_ns:
            self._past.leave()
            self._heard.append((stamp_ns, sequence, row.event))
            self._heard.sort(key=lambda heard: heard[:2])
        elif (found := self._past.at(stamp_ns)) is not None:
            leg, T_keyframe_base = found
            hook = Hook(
                stamp_ns=stamp_ns,
                sequence=sequence,
                keyframe=leg.keyframe,
                T_odom_keyframe=leg.T_odom_start,
                T_keyframe_base=T_keyframe_base,
            )
            leg.tracks.update({track.number: track for track in self.tracks.take(self._reading.sweep(row.event, hook))})
            self._past.see(leg)
        else:
            self.passed_over += 1

    @property
    def ahead(self) -> int:
        """How many perceived sweeps wait for measurements that are soon to come."""
        soon = bool(self._perceived) and self._perceived[0][0] <= self._newest_ns + AHEAD_NS
        return len(self._perceived) if soon else 0

    def _released(self) -> list[Leg]:
        """The legs from what nothing can come before any more."""
        until_ns = self._newest_ns - REORDER_NS
        if self._perceived_ns >= 0:
            until_ns = max(min(until_ns, self._perceived_ns), self._newest_ns - PERCEIVED_WAIT_NS)
        self._released_ns = max(self._released_ns, until_ns)
        legs = []
        while due := [queue for queue in (self._waiting, self._perceived) if queue and queue[0][0] <= until_ns]:
            first = min(due, key=lambda queue: queue[0][0])
            legs += self._after(*heapq.heappop(first))
        return legs

    @property
    def _reading(self) -> SweepReading:
        return SweepReading(described=self.described, settings=self._settings.detections, point_scale=self._scale)

    @property
    def calibration(self) -> Calibration | None:
        """What was learned of the odometry so far, None before the first leg."""
        return self._calibrating.calibration if self._calibrating else None

    def _after(self, stamp_ns: int, sequence: int, event: Event) -> list[Leg]:
        legs = []
        moves = isinstance(event, WheelSpeedMeasured | WheelPairMeasured | ImuMeasured)
        if moves and 0 <= self._due_ns < stamp_ns:
            legs.append(self._closed(stamp_ns if isinstance(event, ImuMeasured) else None, event))
        if isinstance(event, ImuMeasured):
            self._imu.append((stamp_ns, event.yaw_rate_radps))
        elif isinstance(event, GnssFixReceived | LandmarksDetected | LandmarksPerceived):
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

    def _closed(self, imu_ns: int | None, event: Event) -> Leg:
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
        source, stamp_ns = turn_source(drive), drive.wheels.stamp_ns[[0, -1]]
        motions = self._motions(drive, source, stamp_ns)
        motion = Motion(delta=motions.delta[0], derivative=motions.derivative[0], covariance=motions.covariance[0])
        tracks, fixes = self._hung(motions)
        dt_s = float(stamp_ns[1] - stamp_ns[0]) * 1e-9
        calibration = self._calibrated(motion, tracks, source, dt_s=dt_s)
        start, keyframe = self._T_odom_base, self._keyframe
        self._T_odom_base = composed(start[None, :], motion.delta[None, :])[0]
        self._path_m += float(np.hypot(*motion.delta[:2]))
        self._keyframe += 1
        leg = Leg(
            keyframe=keyframe,
            start_ns=int(stamp_ns[0]),
            end_ns=int(stamp_ns[1]),
            T_odom_start=start,
            T_odom_end=self._T_odom_base,
            delta=motion.at(calibration.off),
            covariance=calibration.noise_of(motion, dt_s=dt_s),
            path_m=self._path_m,
            tracks={track.number: track for track in tracks},
            fixes=tuple(fixes),
        )
        self._past.add(leg, motions.path)
        return leg

    def _motions(self, drive: Drive, source: TurnSource, stamp_ns: Ints) -> Motions:
        noise, max_gap_s = odometry_noise(source, self._settings.odometry), self._settings.odometry.max_gap_s
        return keyframe_motions(drive, nominal(int(stamp_ns[0])), stamp_ns, noise=noise, max_gap_s=max_gap_s)

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
            offset = offset_at(motions.path, stamp_ns)
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
                hook = Hook(
                    stamp_ns=stamp_ns,
                    sequence=sequence,
                    keyframe=self._keyframe,
                    T_odom_keyframe=self._T_odom_base,
                    T_keyframe_base=offset,
                )
                seen |= {track.number: track for track in self.tracks.take(self._reading.sweep(event, hook))}
        return [seen[number] for number in sorted(seen)], fixes


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
