"""Every drive of a fleet followed at once; of each vehicle only its newest boots, so that memory is bounded."""

from collections.abc import Collection, Iterator

from trigpoint.events.envelope import Envelope
from trigpoint.events.observed import Observed
from trigpoint_perception.core.drive_following import DriveFollower, Told
from trigpoint_perception.settings import PerceptionSettings

KEPT_BOOTS = 2  # of a vehicle: what the one before spooled may still come while the next one drives

DriveName = tuple[str, str]
ToldOf = tuple[DriveName, list[Told]]


class FleetFollower:
    """Gives out what is certain of every drive as its events are taken. `ended` drives are not followed any more."""

    def __init__(self, settings: PerceptionSettings, *, ended: Collection[DriveName] = ()) -> None:
        self._settings = settings
        self._ended = set(ended)
        self._boots: dict[str, dict[str, DriveFollower]] = {}
        self._of_ended = 0  # sweeps perceived

    @property
    def perceived(self) -> int:
        """Sweeps perceived so far."""
        return self._of_ended + sum(follower.perceived for boots in self._boots.values() for follower in boots.values())

    def has_ended(self, name: DriveName) -> bool:
        """Whether a drive's events are not followed any more."""
        return name in self._ended

    def waiting(self) -> Iterator[DriveName]:
        """The drives with sweeps that wait for later events."""
        for vehicle, boots in self._boots.items():
            yield from ((vehicle, boot_id) for boot_id, follower in boots.items() if follower.waits)

    def take(self, row: Envelope[Observed]) -> Iterator[ToldOf]:
        """What is certain now that one more event is here, by drive."""
        vehicle, boot_id = name = row.identity.source, row.identity.boot_id
        if name in self._ended:
            return
        boots = self._boots.setdefault(vehicle, {})
        if boot_id not in boots:
            boots[boot_id] = DriveFollower(vehicle, boot_id, self._settings)
        yield name, boots[boot_id].take(row)
        if len(boots) > KEPT_BOOTS:
            oldest = vehicle, next(iter(boots))
            yield oldest, self.finished(oldest)
            self._ended.add(oldest)
            self._of_ended += boots.pop(oldest[1]).perceived

    def finished(self, name: DriveName) -> list[Told]:
        """What still waited of a drive given out, as if nothing more came of it."""
        return self._boots[name[0]][name[1]].finished()
