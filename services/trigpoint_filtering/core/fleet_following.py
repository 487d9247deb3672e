"""Every drive of a fleet followed at once; of each vehicle only its newest boots, so that memory is bounded."""

from collections.abc import Collection, Iterator

from trigpoint.events.envelope import Envelope
from trigpoint.events.estimated import Estimated
from trigpoint.events.observed import Observed, VehicleDescribed
from trigpoint.geodesy.projection import MapFrame
from trigpoint_filtering.core.follower import DriveFollower
from trigpoint_filtering.settings import FilterSettings

KEPT_BOOTS = 3  # of a vehicle: what an earlier one spooled may still come while the next one drives

DriveName = tuple[str, str]


class FleetFollower:
    """Gives out every drive's estimates as its events are taken. `ended` drives are not followed any more."""

    def __init__(self, frame: MapFrame, settings: FilterSettings, *, ended: Collection[DriveName] = ()) -> None:
        self.frame = frame
        self._settings = settings
        self._ended = set(ended)
        self._boots: dict[str, dict[str, DriveFollower]] = {}
        self.passed_over = 0  # events of drives that had ended

    def take(self, row: Envelope[Observed]) -> Iterator[Envelope[Estimated]]:
        """The estimates that can be given out now that one more event is here."""
        vehicle, boot_id = row.identity.source, row.identity.boot_id
        if (vehicle, boot_id) in self._ended:
            self.passed_over += 1
            return
        boots = self._boots.setdefault(vehicle, {})
        if boot_id not in boots:
            described = row.event if isinstance(row.event, VehicleDescribed) else VehicleDescribed(vehicle=vehicle)
            boots[boot_id] = DriveFollower(described, boot_id, self.frame, self._settings)
        yield from boots[boot_id].take(row)
        if len(boots) > KEPT_BOOTS:
            yield from self._end(vehicle, next(iter(boots)))

    def _end(self, vehicle: str, boot_id: str) -> Iterator[Envelope[Estimated]]:
        self._ended.add((vehicle, boot_id))
        yield from self._boots[vehicle].pop(boot_id).finish()

    def finish(self) -> Iterator[Envelope[Estimated]]:
        """The estimates from everything that still waited, of all drives."""
        for boots in self._boots.values():
            for follower in boots.values():
                yield from follower.finish()
