"""Wheel and IMU samples folded into motion steps at a bounded rate."""

import math
from dataclasses import dataclass, replace

from trigpoint_filtering.core.motion import MotionStep, TurnSource

SECONDS_PER_NS = 1e-9
IMU_STALE_S = 1.5  # after this without a sample the wheels' own turn is used
WHEEL_STALE_S = 1.5  # above the slowest wheels met (1 Hz)
STANDING_MPS = 0.02  # below the slowest wheel pulse
STANDING_RADPS = 0.05  # a gyroscope's bias and noise at rest stay below


@dataclass(frozen=True, slots=True)
class Odometer:
    """The newest samples, and the motion since the last step taken: sums over `pending_s` seconds."""

    has_wheelbase: bool
    stamp_ns: int = -1
    speed_stamp_ns: int = -1
    speed_mps: float = 0.0
    steering_rad: float = math.nan
    wheel_yaw_rate_radps: float = math.nan
    imu_stamp_ns: int = -1
    imu_yaw_rate_radps: float = math.nan
    pending_s: float = 0.0
    pending_m: float = 0.0
    pending_turn: float = 0.0
    pending_blind_s: float = 0.0
    pending_standing: bool = True
    source: TurnSource | None = None


def after_wheel_sample(
    odometer: Odometer, speed_mps: float, *, steering_rad: float, yaw_rate_radps: float, stamp_ns: int
) -> Odometer:
    """The odometer after a wheel sample: the way since the last sample at the mean of both; NaN where not measured."""
    if not math.isfinite(speed_mps):
        return odometer
    fresh = odometer.speed_stamp_ns < 0 or stamp_ns - odometer.speed_stamp_ns > WHEEL_STALE_S / SECONDS_PER_NS
    before_mps = speed_mps if fresh else odometer.speed_mps
    turning = replace(
        odometer,
        speed_mps=0.5 * (before_mps + speed_mps),
        steering_rad=_mean_with(odometer.steering_rad, steering_rad),
        wheel_yaw_rate_radps=_mean_with(odometer.wheel_yaw_rate_radps, yaw_rate_radps),
    )
    return replace(
        advanced(turning, stamp_ns),
        speed_stamp_ns=max(stamp_ns, odometer.speed_stamp_ns),
        speed_mps=speed_mps,
        steering_rad=steering_rad,
        wheel_yaw_rate_radps=yaw_rate_radps,
    )


def after_imu_sample(odometer: Odometer, yaw_rate_radps: float, *, stamp_ns: int) -> Odometer:
    """The odometer after an IMU sample: the turn since the last sample at the mean of both."""
    if not math.isfinite(yaw_rate_radps):
        return odometer
    mean = replace(odometer, imu_yaw_rate_radps=_mean_with(odometer.imu_yaw_rate_radps, yaw_rate_radps))
    return replace(
        advanced(mean, stamp_ns),
        imu_stamp_ns=max(stamp_ns, odometer.imu_stamp_ns),
        imu_yaw_rate_radps=yaw_rate_radps,
    )


def advanced(odometer: Odometer, stamp_ns: int) -> Odometer:
    """The odometer with its present speed and turn kept up until a stamp; the same for one in the past."""
    if odometer.stamp_ns < 0 or odometer.speed_stamp_ns < 0:
        return replace(odometer, stamp_ns=max(stamp_ns, odometer.stamp_ns))
    dt_s = (stamp_ns - odometer.stamp_ns) * SECONDS_PER_NS
    source = odometer.source if odometer.pending_s > 0.0 else _turn_source(odometer, stamp_ns)
    if dt_s <= 0.0 or source is None:
        return replace(odometer, stamp_ns=max(stamp_ns, odometer.stamp_ns))
    turn = _turn(odometer, source)
    silent_s = (stamp_ns - odometer.speed_stamp_ns) * SECONDS_PER_NS - WHEEL_STALE_S
    standing = abs(odometer.speed_mps) < STANDING_MPS and (source is TurnSource.STEERING or abs(turn) < STANDING_RADPS)
    return replace(
        odometer,
        stamp_ns=stamp_ns,
        pending_s=odometer.pending_s + dt_s,
        pending_m=odometer.pending_m + odometer.speed_mps * dt_s,
        pending_turn=odometer.pending_turn + turn * dt_s,
        pending_blind_s=odometer.pending_blind_s + min(max(silent_s, 0.0), dt_s),
        pending_standing=odometer.pending_standing and standing,
        source=source,
    )


def silent_s(odometer: Odometer, stamp_ns: int) -> float:
    """Seconds since the last wheel sample, 0 before the first."""
    return (stamp_ns - odometer.speed_stamp_ns) * SECONDS_PER_NS if odometer.speed_stamp_ns >= 0 else 0.0


def taken_step(odometer: Odometer) -> tuple[MotionStep | None, Odometer]:
    """The motion since the last step, None if no time passed, and the odometer with nothing pending."""
    if odometer.pending_s <= 0.0 or odometer.source is None:
        return None, odometer
    step = MotionStep(
        odometer.pending_s,
        odometer.pending_m / odometer.pending_s,
        odometer.pending_turn / odometer.pending_s,
        odometer.source,
        odometer.pending_blind_s,
        odometer.pending_standing and odometer.pending_blind_s == 0.0,
    )
    emptied = replace(
        odometer, pending_s=0.0, pending_m=0.0, pending_turn=0.0, pending_blind_s=0.0, pending_standing=True
    )
    return step, emptied


def _mean_with(before: float, after: float) -> float:
    return after if math.isnan(before) or math.isnan(after) else 0.5 * (before + after)


def _turn_source(odometer: Odometer, stamp_ns: int) -> TurnSource | None:
    if odometer.imu_stamp_ns >= 0 and (stamp_ns - odometer.imu_stamp_ns) * SECONDS_PER_NS <= IMU_STALE_S:
        return TurnSource.IMU
    if odometer.has_wheelbase and math.isfinite(odometer.steering_rad):
        return TurnSource.STEERING
    return TurnSource.WHEELS if math.isfinite(odometer.wheel_yaw_rate_radps) else None


def _turn(odometer: Odometer, source: TurnSource) -> float:
    if source is TurnSource.IMU:
        return odometer.imu_yaw_rate_radps
    turn = odometer.steering_rad if source is TurnSource.STEERING else odometer.wheel_yaw_rate_radps
    return turn if math.isfinite(turn) else 0.0
