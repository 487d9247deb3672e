"""What perception found in the sweeps of the drives under way, as it comes into the log."""

import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import cast

from trigpoint.events.envelope import Envelope
from trigpoint.events.perceived import LandmarksPerceived
from trigpoint.logs.following import StreamFollower
from trigpoint.logs.perceived_readings import PERCEIVED_STREAM
from trigpoint.logs.ports import EventLog
from trigpoint_optimisation.core.live_fleet import LiveFleet
from trigpoint_optimisation.core.live_state import DriveName, DrivePlace

BATCH = 64  # events taken at a time
AHEAD_SWEEPS = 300  # of the measurements that are read with them
UNKNOWN_SWEEPS = 400  # kept of drives that have not begun: those that never will are forgotten

Perceived = Envelope[LandmarksPerceived]


class PerceivedLandmarks:
    """Follows perception's stream and gives each sweep to its drive as one of its landmark sensor.

    Of a drive that was perceived by several settings, the first heard of counts. `updated` is told the seconds of each
    update of the map.
    """

    def __init__(
        self, log: EventLog, *, first_number: int, updated: Callable[[float], None] = lambda seconds: None
    ) -> None:
        self._updated = updated
        self._follower = StreamFollower(
            log, [PERCEIVED_STREAM], checkpoint={PERCEIVED_STREAM: first_number}, kinds=(LandmarksPerceived,)
        )
        self._told_as: dict[DriveName, str] = {}
        self._unknown: deque[Perceived] = deque(maxlen=UNKNOWN_SWEEPS)

    @property
    def number(self) -> int:
        """The number after the last event taken."""
        return self._follower.checkpoint[PERCEIVED_STREAM]

    def take(self, fleet: LiveFleet, *, measurements_wait: bool) -> tuple[bool, list[DrivePlace]]:
        """Whether anything was new, and where that brought drives; no farther ahead of the drives than is needed, as
        long as measurements wait in the log."""
        taken, places = False, self.begun(fleet)
        while self._may_go_on(fleet, measurements_wait=measurements_wait) and (rows := self._follower.take(BATCH)):
            taken = True
            places += self._given(fleet, (cast(Perceived, row.envelope) for row in rows))
        return taken, places

    def _may_go_on(self, fleet: LiveFleet, *, measurements_wait: bool) -> bool:
        return fleet.ahead + (len(self._unknown) if measurements_wait else 0) < AHEAD_SWEEPS

    def begun(self, fleet: LiveFleet) -> list[DrivePlace]:
        """Those that waited for their drive to begin given to it, once it has."""
        begun = [row for row in self._unknown if fleet.described(_drive_of(row)) is not None]
        if begun:
            self._unknown = deque((row for row in self._unknown if row not in begun), maxlen=UNKNOWN_SWEEPS)
        return self._given(fleet, begun)

    def _given(self, fleet: LiveFleet, rows: Iterable[Perceived]) -> list[DrivePlace]:
        places: list[DrivePlace] = []
        for row in rows:
            name, told_as = _drive_of(row), row.identity.boot_id
            if fleet.described(name) is None:
                self._unknown.append(row)
            elif self._told_as.setdefault(name, told_as) == told_as:
                began_s = time.perf_counter()
                found = fleet.perceive(row)
                if found:
                    self._updated(time.perf_counter() - began_s)
                places += found
        return places


def _drive_of(row: Perceived) -> DriveName:
    return row.event.vehicle, row.event.boot_id
