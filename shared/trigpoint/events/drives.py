"""One drive's observations as arrays: what the estimating cores work on, folded from its events."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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

DRIVE_KINDS: tuple[type, ...] = (
    VehicleDescribed,
    WheelSpeedMeasured,
    WheelPairMeasured,
    ImuMeasured,
    GnssFixReceived,
    LandmarksDetected,
)
"""The classes of events a drive is folded from; points are not among them."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

CAMERA = "camera"  # VehicleDescribed.landmark_sensor_model


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelSeries:
    """Speeds (n,) in m/s of the base or of the wheel at `speed_wheel_y_m`; steering and yaw rate NaN where
    not measured. A wheel pair becomes mean speed and (right - left) / track."""

    stamp_ns: Ints
    speed_mps: Floats
    steering_rad: Floats
    yaw_rate_radps: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuSeries:
    """Yaw rates (n,) in rad/s."""

    stamp_ns: Ints
    yaw_rate_radps: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class FixSeries:
    """GNSS fixes (n,), degrees; sigma NaN where not declared; `sequence` names the event in its boot."""

    stamp_ns: Ints
    lat_deg: Floats
    lon_deg: Floats
    sigma_m: Floats
    sequence: Ints


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectionSeries:
    """Landmark detections (n,), one row each, in order of time; `sequence` names the sweep's event.

    Bearing counter-clockwise from ahead in the sensor's frame; kind and signature as in LandmarkDetection.
    `covariance_m2` (n, 2, 2) of x ahead and y left in the base frame; None where the sensor tells none.
    """

    stamp_ns: Ints
    range_m: Floats
    bearing_rad: Floats
    diameter_m: Floats
    kind: tuple[str, ...]
    signature: tuple[str, ...]
    sequence: Ints
    covariance_m2: Floats | None = None

    def chosen(self, rows: Ints) -> "DetectionSeries":
        """The detections of some rows, by index."""
        return DetectionSeries(
            stamp_ns=self.stamp_ns[rows],
            range_m=self.range_m[rows],
            bearing_rad=self.bearing_rad[rows],
            diameter_m=self.diameter_m[rows],
            kind=tuple(self.kind[row] for row in rows),
            signature=tuple(self.signature[row] for row in rows),
            sequence=self.sequence[rows],
            covariance_m2=None if self.covariance_m2 is None else self.covariance_m2[rows],
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionSeries:
    """Measured motions (n,) of the base from one stamp to a later one, or to another drive's: motion (n, 3) its x, y in
    m and heading in rad at the later stamp in the base frame at the earlier one; covariance (n, 3, 3) of the three."""

    from_stamp_ns: Ints
    stamp_ns: Ints
    motion: Floats
    covariance: Floats

    def chosen(self, rows: Ints | Bools) -> "MotionSeries":
        """The motions of some rows, by index or mask."""
        return MotionSeries(
            from_stamp_ns=self.from_stamp_ns[rows],
            stamp_ns=self.stamp_ns[rows],
            motion=self.motion[rows],
            covariance=self.covariance[rows],
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopSeries:
    """Places known again (n,): `other` (n,) names vehicle and boot of the drive that was there before, possibly this
    one; `motions` are from the other's base at `from_stamp_ns` to this drive's at `stamp_ns`."""

    other: tuple[tuple[str, str], ...]
    motions: MotionSeries


NO_FIXES = FixSeries(
    stamp_ns=np.zeros(0, dtype=np.int64),
    lat_deg=np.zeros(0),
    lon_deg=np.zeros(0),
    sigma_m=np.zeros(0),
    sequence=np.zeros(0, dtype=np.int64),
)
NO_DETECTIONS = DetectionSeries(
    stamp_ns=np.zeros(0, dtype=np.int64),
    range_m=np.zeros(0),
    bearing_rad=np.zeros(0),
    diameter_m=np.zeros(0),
    kind=(),
    signature=(),
    sequence=np.zeros(0, dtype=np.int64),
)
NO_MOTIONS = MotionSeries(
    from_stamp_ns=np.zeros(0, dtype=np.int64),
    stamp_ns=np.zeros(0, dtype=np.int64),
    motion=np.zeros((0, 3)),
    covariance=np.zeros((0, 3, 3)),
)
NO_LOOPS = LoopSeries(other=(), motions=NO_MOTIONS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """Everything one vehicle measured in one boot, and what was perceived in its points. Each series is sorted by time,
    not by arrival. `matched`: the base's motions from sweep to sweep, by matching points, sensor by sensor; `loops`:
    places known again."""

    vehicle: str
    boot_id: str
    described: VehicleDescribed
    wheels: WheelSeries
    imu: ImuSeries
    fixes: FixSeries
    detections: DetectionSeries
    matched: MotionSeries = NO_MOTIONS
    loops: LoopSeries = NO_LOOPS


def _column(values: Iterable[float]) -> Floats:
    return np.fromiter(values, dtype=np.float64)


def _stamps(rows: Iterable[Envelope[object]]) -> Ints:
    return np.fromiter((row.stamp_ns for row in rows), dtype=np.int64)


def _wheel_series(
    singles: list[Envelope[WheelSpeedMeasured]], pairs: list[Envelope[WheelPairMeasured]], track_m: float
) -> WheelSeries:
    left, right = _column(row.event.left_mps for row in pairs), _column(row.event.right_mps for row in pairs)
    pair_yaw_rate = (right - left) / track_m if track_m > 0.0 else np.full(len(pairs), np.nan)
    stamp_ns = np.concatenate([_stamps(singles), _stamps(pairs)])
    order = np.argsort(stamp_ns, kind="stable")
    speed = np.concatenate([_column(row.event.speed_mps for row in singles), 0.5 * (left + right)])
    steering = np.concatenate([_column(row.event.steering_rad for row in singles), np.full(len(pairs), np.nan)])
    yaw_rate = np.concatenate([_column(row.event.yaw_rate_radps for row in singles), pair_yaw_rate])
    return WheelSeries(
        stamp_ns=stamp_ns[order],
        speed_mps=speed[order],
        steering_rad=steering[order],
        yaw_rate_radps=yaw_rate[order],
    )


def _imu_series(rows: list[Envelope[ImuMeasured]]) -> ImuSeries:
    return ImuSeries(stamp_ns=_stamps(rows), yaw_rate_radps=_column(row.event.yaw_rate_radps for row in rows))


def fix_series(rows: Sequence[Envelope[GnssFixReceived]]) -> FixSeries:
    """Fixes in their order."""
    return FixSeries(
        stamp_ns=_stamps(rows),
        lat_deg=_column(row.event.lat_deg for row in rows),
        lon_deg=_column(row.event.lon_deg for row in rows),
        sigma_m=_column(row.event.sigma_m for row in rows),
        sequence=np.fromiter((row.identity.sequence for row in rows), dtype=np.int64),
    )


def _detection_series(rows: list[Envelope[LandmarksDetected]]) -> DetectionSeries:
    flat = [(row.stamp_ns, row.identity.sequence, seen) for row in rows for seen in row.event.detections]
    return DetectionSeries(
        stamp_ns=np.array([stamp_ns for stamp_ns, _, _ in flat], dtype=np.int64),
        range_m=_column(seen.range_m for _, _, seen in flat),
        bearing_rad=_column(seen.bearing_rad for _, _, seen in flat),
        diameter_m=_column(seen.diameter_m for _, _, seen in flat),
        kind=tuple(seen.kind for _, _, seen in flat),
        signature=tuple(seen.signature for _, _, seen in flat),
        sequence=np.array([sequence for _, sequence, _ in flat], dtype=np.int64),
    )


def drives_of(events: Iterable[Envelope[Observed]]) -> tuple[Drive, ...]:
    """One Drive for each (vehicle, boot) in the events, in order of vehicle and first stamp.

    Events may come in any order between kinds, those of other classes than DRIVE_KINDS are passed over; a drive
    without VehicleDescribed gets an all-zero one.
    """
    by_drive: dict[tuple[str, str], dict[type, list[Envelope[Observed]]]] = {}
    for row in events:
        if not isinstance(row.event, DRIVE_KINDS):
            continue
        kinds = by_drive.setdefault((row.identity.source, row.identity.boot_id), {})
        kinds.setdefault(type(row.event), []).append(row)
    drives = [_drive(vehicle, boot_id, kinds) for (vehicle, boot_id), kinds in by_drive.items()]
    return tuple(sorted(drives, key=lambda drive: (drive.vehicle, first_stamp_ns(drive), drive.boot_id)))


def first_stamp_ns(drive: Drive) -> int:
    """The earliest stamp of any series of a drive, 0 for an empty one."""
    series = (drive.wheels.stamp_ns, drive.imu.stamp_ns, drive.fixes.stamp_ns, drive.detections.stamp_ns)
    return min((int(stamps[0]) for stamps in series if len(stamps)), default=0)


def _drive(vehicle: str, boot_id: str, kinds: dict[type, list[Envelope[Observed]]]) -> Drive:
    def rows(kind: type) -> list:  # type: ignore[type-arg]
        return sorted(kinds.get(kind, []), key=lambda row: row.stamp_ns)

    described = rows(VehicleDescribed)
    description = described[-1].event if described else VehicleDescribed(vehicle=vehicle)
    return Drive(
        vehicle=vehicle,
        boot_id=boot_id,
        described=description,
        wheels=_wheel_series(rows(WheelSpeedMeasured), rows(WheelPairMeasured), description.track_m),
        imu=_imu_series(rows(ImuMeasured)),
        fixes=fix_series(rows(GnssFixReceived)),
        detections=_detection_series(rows(LandmarksDetected)),
    )
