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
    """The odometer after a wheel sample: the way since the last sample at the mean of both; NaN where not measured."""
    if not math.isfinite(speed_mps):
        return odometer
    stale = stamp_ns - odometer.wheel.stamp_ns > WHEEL_STALE_S / SECONDS_PER_NS
    before = WheelSample(stamp_ns, speed_mps, steering_rad, yaw_rate_radps) if stale else odometer.wheel
    mean = WheelSample(
        odometer.wheel.stamp_ns,
        0.5 * (before.speed_mps + speed_mps),
        _mean_with(before.steering_rad, steering_rad),
        _mean_with(before.yaw_rate_radps, yaw_rate_radps),
    )
    newest = WheelSample(max(stamp_ns, odometer.wheel.stamp_ns), speed_mps, steering_rad, yaw_rate_radps)
    pending, source = _after(odometer, mean, odometer.imu, stamp_ns)
    newest_ns = max(stamp_ns, odometer.stamp_ns)
    return Odometer(odometer.has_wheelbase, newest_ns, newest, odometer.imu, pending, source)


def after_imu_sample(odometer: Odometer, yaw_rate_radps: float, *, stamp_ns: int) -> Odometer:
    """The odometer after an IMU sample: the turn since the last sample at the mean of both."""
    if not math.isfinite(yaw_rate_radps):
        return odometer
    mean = ImuSample(odometer.imu.stamp_ns, _mean_with(odometer.imu.yaw_rate_radps, yaw_rate_radps))
    newest = ImuSample(max(stamp_ns, odometer.imu.stamp_ns), yaw_rate_radps)
    pending, source = _after(odometer, odometer.wheel, mean, stamp_ns)
    newest_ns = max(stamp_ns, odometer.stamp_ns)
    return Odometer(odometer.has_wheelbase, newest_ns, odometer.wheel, newest, pending, source)


def advanced(odometer: Odometer, stamp_ns: int) -> Odometer:
    """The odometer with its present speed and turn kept up until a stamp; the same for one in the past."""
    pending, source = _after(odometer, odometer.wheel, odometer.imu, stamp_ns)
    newest_ns = max(stamp_ns, odometer.stamp_ns)
    return Odometer(odometer.has_wheelbase, newest_ns, odometer.wheel, odometer.imu, pending, source)


def _after(
    odometer: Odometer, wheel: WheelSample, imu: ImuSample, stamp_ns: int
) -> tuple[Pending, TurnSource | None]:
    """What is pending once `wheel` and `imu` have held from the odometer's stamp until another."""
    before = odometer.pending
    if odometer.stamp_ns < 0 or wheel.stamp_ns < 0 or stamp_ns <= odometer.stamp_ns:
        return before, odometer.source
    source = odometer.source if before.s > 0.0 else _turn_source(odometer, wheel, stamp_ns)
    if source is None:
        return before, source
    dt_s = (stamp_ns - odometer.stamp_ns) * SECONDS_PER_NS
    turn = _turn(wheel, imu, source)
    silent = (stamp_ns - wheel.stamp_ns) * SECONDS_PER_NS - WHEEL_STALE_S
    standing = abs(wheel.speed_mps) < STANDING_MPS and (source is TurnSource.STEERING or abs(turn) < STANDING_RADPS)
    pending = Pending(
        before.s + dt_s,
        before.way_m + wheel.speed_mps * dt_s,
        before.turn + turn * dt_s,
        before.blind_s + min(max(silent, 0.0), dt_s),
        before.standing and standing,
    )
    return pending, source


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
        pending.standing and pending.blind_s == 0.0,
    )
    return step, replace(odometer, pending=NOTHING_PENDING)


def _mean_with(before: float, after: float) -> float:
    return after if math.isnan(before) or math.isnan(after) else 0.5 * (before + after)


def _turn_source(odometer: Odometer, wheel: WheelSample, stamp_ns: int) -> TurnSource | None:
    imu_ns = odometer.imu.stamp_ns
    if imu_ns >= 0 and (stamp_ns - imu_ns) * SECONDS_PER_NS <= IMU_STALE_S:
        return TurnSource.IMU
    if odometer.has_wheelbase and math.isfinite(wheel.steering_rad):
        return TurnSource.STEERING
    return TurnSource.WHEELS if math.isfinite(wheel.yaw_rate_radps) else None


def _turn(wheel: WheelSample, imu: ImuSample, source: TurnSource) -> float:
    if source is TurnSource.IMU:
        return imu.yaw_rate_radps
    turn = wheel.steering_rad if source is TurnSource.STEERING else wheel.yaw_rate_radps
    return turn if math.isfinite(turn) else 0.0
