"""What a drive's wheels and gyroscope measured about one sweep, of samples that come in the log's order."""

from collections import deque
from dataclasses import dataclass, field

from trigpoint.events.drives import drives_of
from trigpoint.events.envelope import Envelope
from trigpoint.events.observed import (
    ImuMeasured,
    Observed,
    VehicleDescribed,
    WheelPairMeasured,
    WheelSpeedMeasured,
)
from trigpoint_perception.core.deskew import NS_PER_S, Path
from trigpoint_perception.core.motion_prior import wheel_path

MOTION_KINDS = (VehicleDescribed, WheelSpeedMeasured, WheelPairMeasured, ImuMeasured)
KEPT_S = 3.0  # longer than between two sweeps that are matched, with the samples about them
BEFORE_NS = round(KEPT_S * NS_PER_S)

Samples = deque[Envelope[Observed]]


@dataclass(slots=True)
class MotionWindow:
    """The last seconds of a drive's wheel and IMU samples; where the clock steps back, only what came since."""

    _described: Envelope[Observed] | None = None
    _wheels: Samples = field(default_factory=deque)
    _imu: Samples = field(default_factory=deque)

    def take(self, row: Envelope[Observed]) -> None:
        """One more event of the drive."""
        if isinstance(row.event, VehicleDescribed):
            self._described = row
        elif isinstance(row.event, ImuMeasured):
            _add(self._imu, row)
        elif isinstance(row.event, WheelSpeedMeasured | WheelPairMeasured):
            _add(self._wheels, row)

    def reaches(self, stamp_ns: int) -> bool:
        """Whether nothing before a stamp is still to come: every kind of sample there is reaches it."""
        return all(samples[-1].stamp_ns >= stamp_ns for samples in (self._wheels, self._imu) if samples)

    def path(self, first_ns: int, last_ns: int) -> Path | None:
        """The base's path by dead reckoning that holds the closed range of stamps, as far as there are samples; None as
        `wheel_path` has it."""
        wheels = _about(self._wheels, first_ns, last_ns)
        if not wheels:
            return None
        imu = _about(self._imu, wheels[0].stamp_ns, wheels[-1].stamp_ns)
        described = [] if self._described is None else [self._described]
        (drive,) = drives_of([*described, *wheels, *imu])
        return wheel_path(drive)


def _add(samples: Samples, row: Envelope[Observed]) -> None:
    if samples and row.stamp_ns < samples[-1].stamp_ns - BEFORE_NS:
        samples.clear()
    samples.append(row)
    while samples[0].stamp_ns < row.stamp_ns - BEFORE_NS:
        samples.popleft()


def _about(samples: Samples, first_ns: int, last_ns: int) -> list[Envelope[Observed]]:
    """The samples in a closed range of stamps, and the nearest one to either side of it."""
    before = max((row.stamp_ns for row in samples if row.stamp_ns <= first_ns), default=first_ns)
    after = min((row.stamp_ns for row in samples if row.stamp_ns >= last_ns), default=last_ns)
    return [row for row in samples if before <= row.stamp_ns <= after]
