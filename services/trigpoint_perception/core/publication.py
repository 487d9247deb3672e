"""What perception gives out of a drive, numbered as events, and what of it is there already."""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, field

from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.perceived import LandmarksPerceived, OdometryMatched, Perceived
from trigpoint_perception.settings import PerceptionSettings

SOURCE = "perception"


def output_boot_id(vehicle: str, boot_id: str, settings: PerceptionSettings) -> str:
    """The boot under which a drive's perceptions are numbered: the same for the same drive and settings."""
    digest = hashlib.sha256(f"{vehicle}|{boot_id}|{settings}".encode()).hexdigest()[:12]
    return f"{vehicle[:40]}-{digest}"


def numbered(
    told: Iterable[tuple[int, Perceived]], *, boot_id: str, first_sequence: int
) -> tuple[Envelope[Perceived], ...]:
    """Events with their stamps as envelopes, numbered on from `first_sequence`."""
    return tuple(
        Envelope(EventIdentity(SOURCE, boot_id, first_sequence + number), stamp_ns, event)
        for number, (stamp_ns, event) in enumerate(told)
    )


@dataclass(slots=True)
class Said:
    """What of a drive was told: events, sweeps, motions, landmarks' sights, sweeps refused by reason, and the things
    themselves, by sensor, kind and track."""

    count: int = 0
    sweeps: int = 0
    motions: int = 0
    sights: int = 0
    refused: dict[str, int] = field(default_factory=dict)
    things: set[tuple[str, str, int]] = field(default_factory=set)

    def add(self, event: Perceived) -> None:
        """Take one more event into account."""
        self.count += 1
        if isinstance(event, OdometryMatched):
            self.motions += 1
        if isinstance(event, LandmarksPerceived):
            self._add_sweep(event)

    def _add_sweep(self, event: LandmarksPerceived) -> None:
        self.sweeps += 1
        self.sights += len(event.landmarks)
        self.things |= {(event.sensor, one.kind, one.track) for one in event.landmarks}
        if event.refusal:
            reason = event.refusal.partition(":")[0]
            self.refused[reason] = self.refused.get(reason, 0) + 1

    def things_of(self, kind: str) -> int:
        """How many things of a kind were told of."""
        return sum(each[1] == kind for each in self.things)
