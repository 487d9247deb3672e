"""The times of a drive: each sensor's go forward, and none leaves the drive's own stretch of time."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

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

    def accept_run(self, stamps_ns: NDArray[np.int64], of_sensor: Mapping[type, NDArray[np.int64]]) -> None:
        """The stamps of many events taken into the drive, and those of each sensor; none is a description's."""
        earliest_ns, latest_ns = int(stamps_ns.min()), int(stamps_ns.max())
        self.earliest_ns = earliest_ns if self.earliest_ns is None else min(self.earliest_ns, earliest_ns)
        self.latest_ns = max(self.latest_ns, latest_ns)
        for sensor, own_ns in of_sensor.items():
            self.latest_of_sensor_ns[sensor] = max(int(own_ns.max()), self.latest_of_sensor_ns.get(sensor, -1))


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


def stamps_fit(
    stamps_ns: NDArray[np.int64], of_sensor: Mapping[type, NDArray[np.int64]], stamps: DriveStamps, limits: StampLimits
) -> bool:
    """Whether `require_stamp` would refuse none of these events (n,), none a description, taken one after the other;
    `of_sensor` are the stamps of each sensor."""
    if int(stamps_ns.min()) < 0:
        return False
    tolerance_ns = round(limits.backwards_tolerance_s * NS_PER_S)
    for sensor, own_ns in of_sensor.items():
        first_ns = stamps.latest_of_sensor_ns.get(sensor, int(own_ns[0]))
        if bool((_latest_before(own_ns, first_ns) - own_ns > tolerance_ns).any()):
            return False
    jump_ns = round(limits.jump_limit_s * NS_PER_S)
    first_ns = int(stamps_ns[0])
    known = (first_ns, first_ns) if stamps.earliest_ns is None else (stamps.earliest_ns, stamps.latest_ns)
    earliest_ns, latest_ns = -_latest_before(-stamps_ns, -known[0]), _latest_before(stamps_ns, known[1])
    return not bool((np.maximum(stamps_ns - latest_ns, earliest_ns - stamps_ns) > jump_ns).any())


def _latest_before(stamps_ns: NDArray[np.int64], first_ns: int) -> NDArray[np.int64]:
    """Of each stamp the latest of `first_ns` and those before it."""
    before = np.empty_like(stamps_ns)
    before[0], before[1:] = first_ns, stamps_ns[:-1]
    latest: NDArray[np.int64] = np.maximum.accumulate(before)
    return latest
