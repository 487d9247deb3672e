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
class WheelSample:
    """The newest word of the wheels; stamp -1 before the first, steering and yaw rate NaN where not measured."""

    stamp_ns: int = -1
    speed_mps: float = 0.0
    steering_rad: float = math.nan
    yaw_rate_radps: float = math.nan


@dataclass(frozen=True, slots=True)
class ImuSample:
    """The newest word of the IMU; stamp -1 before the first."""

    stamp_ns: int = -1
    yaw_rate_radps: float = math.nan


@dataclass(frozen=True, slots=True)
class Pending:
    """Motion since the last step taken, summed over `s` seconds: way in m, turn in its unit times seconds."""

    s: float = 0.0
    way_m: float = 0.0
    turn: float = 0.0
    blind_s: float = 0.0
    longest_s: float = 0.0
    standing: bool = True


NOTHING_PENDING = Pending()


@dataclass(frozen=True, slots=True)
class Odometer:
    """The newest samples, and the motion they have brought since the last step was taken."""

    has_wheelbase: bool
    stamp_ns: int = -1
    wheel: WheelSample = WheelSample()
    imu: ImuSample = ImuSample()
    pending: Pending = NOTHING_PENDING
    source: TurnSource | None = None


def after_wheel_sample(
    odometer: Odometer, speed_mps: float, *, steering_rad: float, yaw_rate_radps: float, stamp_ns: int
) -> Odometer:
    """The odometer after a wheel sample, which holds for the time since the last; NaN where not measured.

    Wheels count pulses over the interval that ends at their stamp.
    """
    if not math.isfinite(speed_mps):
        return odometer
    newest = WheelSample(max(stamp_ns, odometer.wheel.stamp_ns), speed_mps, steering_rad, yaw_rate_radps)
    return _advanced(odometer, newest, odometer.imu, stamp_ns)


def after_imu_sample(odometer: Odometer, yaw_rate_radps: float, *, stamp_ns: int) -> Odometer:
    """The odometer after an IMU sample, which holds for the time since the last."""
    if not math.isfinite(yaw_rate_radps):
        return odometer
    newest = ImuSample(max(stamp_ns, odometer.imu.stamp_ns), yaw_rate_radps)
    return _advanced(odometer, odometer.wheel, newest, stamp_ns)


def advanced(odometer: Odometer, stamp_ns: int) -> Odometer:
    """The odometer with its present speed and turn kept up until a stamp; the same for one in the past."""
    return _advanced(odometer, odometer.wheel, odometer.imu, stamp_ns)


def _advanced(odometer: Odometer, wheel: WheelSample, imu: ImuSample, stamp_ns: int) -> Odometer:
    """The odometer with `wheel` and `imu` as its samples, held from its own stamp until another."""
    newest_ns = max(stamp_ns, odometer.stamp_ns)
    pending, source = odometer.pending, odometer.source
    if 0 <= odometer.stamp_ns < stamp_ns and odometer.wheel.stamp_ns >= 0:
        source = source if pending.s > 0.0 else _turn_source(wheel, imu, odometer.has_wheelbase, stamp_ns)
        pending = _longer(odometer, wheel, imu, source, stamp_ns) if source else pending
    return Odometer(odometer.has_wheelbase, newest_ns, wheel, imu, pending, source)


def _longer(odometer: Odometer, wheel: WheelSample, imu: ImuSample, source: TurnSource, stamp_ns: int) -> Pending:
    before = odometer.pending
    dt_s = (stamp_ns - odometer.stamp_ns) * SECONDS_PER_NS
    turn = _turn(wheel, imu, source)
    silent_s = (stamp_ns - odometer.wheel.stamp_ns) * SECONDS_PER_NS
    standing = abs(wheel.speed_mps) < STANDING_MPS and (source is TurnSource.STEERING or abs(turn) < STANDING_RADPS)
    return Pending(
        before.s + dt_s,
        before.way_m + wheel.speed_mps * dt_s,
        before.turn + turn * dt_s,
        before.blind_s + min(max(silent_s - WHEEL_STALE_S, 0.0), dt_s),
        max(before.longest_s, dt_s),
        before.standing and standing,
    )


def silent_s(odometer: Odometer, stamp_ns: int) -> float:
    """Seconds since the last wheel sample, 0 before the first."""
    return (stamp_ns - odometer.wheel.stamp_ns) * SECONDS_PER_NS if odometer.wheel.stamp_ns >= 0 else 0.0


def taken_step(odometer: Odometer) -> tuple[MotionStep | None, Odometer]:
    """The motion since the last step, None if no time passed, and the odometer with nothing pending."""
    pending = odometer.pending
    if pending.s <= 0.0 or odometer.source is None:
        return None, odometer
    step = MotionStep(
        pending.s,
        pending.way_m / pending.s,
        pending.turn / pending.s,
        odometer.source,
        pending.blind_s,
        pending.longest_s,
        pending.standing and pending.blind_s == 0.0,
    )
    return step, replace(odometer, pending=NOTHING_PENDING)


def _turn_source(wheel: WheelSample, imu: ImuSample, has_wheelbase: bool, stamp_ns: int) -> TurnSource | None:
    if imu.stamp_ns >= 0 and (stamp_ns - imu.stamp_ns) * SECONDS_PER_NS <= IMU_STALE_S:
        return TurnSource.IMU
    if has_wheelbase and math.isfinite(wheel.steering_rad):
        return TurnSource.STEERING
    return TurnSource.WHEELS if math.isfinite(wheel.yaw_rate_radps) else None


def _turn(wheel: WheelSample, imu: ImuSample, source: TurnSource) -> float:
    if source is TurnSource.IMU:
        return imu.yaw_rate_radps
    turn = wheel.steering_rad if source is TurnSource.STEERING else wheel.yaw_rate_radps
    return turn if math.isfinite(turn) else 0.0
