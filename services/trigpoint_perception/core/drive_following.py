"""One drive followed from its events in the log's order, all its sensors: what it gives out is in that order too."""

from collections import deque

from trigpoint.events.envelope import Envelope
from trigpoint.events.observed import Observed
from trigpoint.events.perceived import LandmarksPerceived, SweepPerceived
from trigpoint.events.scanned import PointsScanned
from trigpoint_perception.core.deskew import NS_PER_S
from trigpoint_perception.core.following import NumberedSweep, SweepFollower
from trigpoint_perception.core.motion_window import MotionWindow
from trigpoint_perception.settings import PerceptionSettings

HELD_NS = 500_000_000  # so far from the newest event's stamp a sweep does not wait for what reaches its end
HELD_SWEEPS = 8  # nor behind so many others

Told = tuple[int, SweepPerceived]


class DriveFollower:
    """Follows one boot of one vehicle; the same events give the same, whenever each is taken.

    A sweep is perceived once wheels and gyroscope reach its end. Memory is bounded, however long the drive.
    """

    def __init__(self, vehicle: str, boot_id: str, settings: PerceptionSettings) -> None:
        self._vehicle, self._boot_id, self._settings = vehicle, boot_id, settings
        self._motion = MotionWindow()
        self._sensors: dict[str, SweepFollower] = {}
        self._held: deque[NumberedSweep] = deque()
        self._newest_ns = 0
        self._order: deque[int] = deque()  # of sweeps not given out yet
        self._told: dict[int, list[Told]] = {}  # of those what is certain already
        self.perceived = 0  # sweeps

    @property
    def waits(self) -> bool:
        """Whether a sweep waits to be given out."""
        return bool(self._order)

    def take(self, row: Envelope[Observed]) -> list[Told]:
        """The events, with their stamps, that are certain now that one more of the drive's is here."""
        if isinstance(row.event, PointsScanned):
            sweep = NumberedSweep(sequence=row.identity.sequence, stamp_ns=row.stamp_ns, scanned=row.event)
            self._held.append(sweep)
            self._order.append(sweep.sequence)
        else:
            self._motion.take(row)
        self._newest_ns = row.stamp_ns
        while self._held and self._is_due(self._held[0]):
            self._perceive(self._held.popleft())
        return self._ready()

    def finished(self) -> list[Told]:
        """What still waited given out, as if nothing more came; where it comes after all it is followed on."""
        while self._held:
            self._perceive(self._held.popleft())
        for follower in self._sensors.values():
            self._keep(follower.finished())
        return self._ready()

    def _is_due(self, sweep: NumberedSweep) -> bool:
        late = abs(self._newest_ns - sweep.stamp_ns) > HELD_NS
        return late or len(self._held) > HELD_SWEEPS or self._motion.reaches(_end_ns(sweep))

    def _perceive(self, sweep: NumberedSweep) -> None:
        sensor = sweep.scanned.sensor
        follower = self._sensors.get(sensor)
        if follower is None:
            follower = self._sensors[sensor] = SweepFollower(self._vehicle, self._boot_id, self._settings)
        follower.lead_by(self._motion.path(self._first_ns(follower, sweep), _end_ns(sweep)))
        self._keep(follower.take(sweep))
        self.perceived += 1

    def _first_ns(self, follower: SweepFollower, sweep: NumberedSweep) -> int:
        """From where on the base's motion counts: the sweep before, or the sweep's first point."""
        begin_ns = sweep.stamp_ns + _offsets_ns(sweep)[0]
        last_ns = follower.last_stamp_ns
        gap_ns = round(self._settings.odometry.gap_max_s * NS_PER_S)
        return begin_ns if last_ns is None or last_ns < sweep.stamp_ns - gap_ns else min(begin_ns, last_ns)

    def _keep(self, told: tuple[Told, ...]) -> None:
        for one in told:
            self._told.setdefault(one[1].sweep_sequence, []).append(one)

    def _ready(self) -> list[Told]:
        """What is certain of the sweeps before which nothing waits; a sweep's LandmarksPerceived is its last event."""
        ready: list[Told] = []
        while self._order and self._is_whole(self._order[0]):
            ready += self._told.pop(self._order.popleft())
        return ready

    def _is_whole(self, sequence: int) -> bool:
        told = self._told.get(sequence)
        return told is not None and isinstance(told[-1][1], LandmarksPerceived)


def _offsets_ns(sweep: NumberedSweep) -> tuple[int, int]:
    """Of the first and the last point, 0 for a sweep without points."""
    offset_ns = sweep.scanned.offset_ns
    return (int(offset_ns.min()), int(offset_ns.max())) if len(offset_ns) else (0, 0)


def _end_ns(sweep: NumberedSweep) -> int:
    return sweep.stamp_ns + _offsets_ns(sweep)[1]
