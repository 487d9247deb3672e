"""The times of a drive: each sensor's go forward, and none leaves the drive's own stretch of time."""

from dataclasses import dataclass, field

from trigpoint.errors import EventRejected
from trigpoint.events.observed import VehicleDescribed

NS_PER_S = 1_000_000_000
STAMP_LIMIT_NS = 2**63  # signed 64 bits: the year 2262

TIME_BACKWARDS = "time backwards"
TIME_JUMPED = "time jumped"
STAMP_OUT_OF_RANGE = "stamp out of range"


@dataclass(slots=True)
class DriveStamps:
    """The times accepted so far of one drive: the earliest, the latest, and each sensor's latest, in ns."""

    earliest_ns: int | None = None
    latest_ns: int = 0
    latest_of_sensor_ns: dict[type, int] = field(default_factory=dict)

    def accept(self, sensor: type, stamp_ns: int) -> None:
        """The stamp taken into the drive; a description, which may be older than the drive, is left out."""
        if sensor is VehicleDescribed:
            return
        if self.earliest_ns is None or stamp_ns < self.earliest_ns:
            self.earliest_ns = stamp_ns
        if stamp_ns > self.latest_ns:
            self.latest_ns = stamp_ns
        if stamp_ns > self.latest_of_sensor_ns.get(sensor, -1):
            self.latest_of_sensor_ns[sensor] = stamp_ns


@dataclass(frozen=True, slots=True, kw_only=True)
class StampLimits:
    """How far back of its own latest a sensor's stamp may lie, and how far from all of the drive's stamps."""

    backwards_tolerance_s: float = 10.0  # transports and queues reorder by seconds
    jump_limit_s: float = 1800.0  # a vehicle that sleeps longer starts a new drive


def require_stamp(sensor: type, stamp_ns: int, stamps: DriveStamps, limits: StampLimits) -> None:
    """Nothing, if the stamp fits the drive. Raises EventRejected with reason "stamp out of range",
    "time backwards" (against the sensor's own latest) or "time jumped" (against all of the drive).
    """
    if not 0 <= stamp_ns < STAMP_LIMIT_NS:
        raise EventRejected(STAMP_OUT_OF_RANGE, f"{stamp_ns} ns is outside 0 to {STAMP_LIMIT_NS} ns")
    if stamps.earliest_ns is None or sensor is VehicleDescribed:
        return
    latest_ns = stamps.latest_of_sensor_ns.get(sensor)
    if latest_ns is not None and latest_ns - stamp_ns > limits.backwards_tolerance_s * NS_PER_S:
        raise EventRejected(
            TIME_BACKWARDS,
            f"{stamp_ns} ns is {(latest_ns - stamp_ns) / NS_PER_S:.3f} s before {latest_ns} ns of the same sensor, "
            f"limit {limits.backwards_tolerance_s:g} s",
        )
    away_ns = max(stamp_ns - stamps.latest_ns, stamps.earliest_ns - stamp_ns)
    if away_ns > limits.jump_limit_s * NS_PER_S:
        raise EventRejected(
            TIME_JUMPED,
            f"{stamp_ns} ns is {away_ns / NS_PER_S:.3f} s from the drive's {stamps.earliest_ns} to "
            f"{stamps.latest_ns} ns, limit {limits.jump_limit_s:g} s",
        )
