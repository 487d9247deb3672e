"""What perception gives out of a drive, numbered as events, and what of it is there already."""

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TypeVar

from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.perceived import LandmarksPerceived, OdometryMatched, Perceived, SweepPerceived
from trigpoint_perception.settings import PerceptionSettings

SOURCE = "perception"

One = TypeVar("One", bound=Perceived)


def output_boot_id(vehicle: str, boot_id: str, settings: PerceptionSettings) -> str:
    """The boot under which a drive's perceptions are numbered: the same for the same drive and settings."""
    digest = hashlib.sha256(f"{vehicle}|{boot_id}|{settings}".encode()).hexdigest()[:12]
    return f"{vehicle[:40]}-{digest}"


def numbered(told: Iterable[tuple[int, One]], *, boot_id: str, first_sequence: int) -> tuple[Envelope[One], ...]:
    """Events with their stamps as envelopes, numbered on from `first_sequence`."""
    return tuple(
        Envelope(EventIdentity(SOURCE, boot_id, first_sequence + number), stamp_ns, event)
        for number, (stamp_ns, event) in enumerate(told)
    )


def reason_of(refusal: str) -> str:
    """The kind of a refusal, without what is particular to its sweep."""
    return refusal.partition(":")[0]


@dataclass(slots=True)
class Said:
    """What of a drive was told: sweeps, motions, landmarks' sights, sweeps refused by reason, and the things
    themselves, by sensor, kind and track."""

    sweeps: int = 0
    motions: int = 0
    sights: int = 0
    refused: dict[str, int] = field(default_factory=dict)
    things: set[tuple[str, str, int]] = field(default_factory=set)

    def add(self, event: SweepPerceived) -> None:
        """Take one more event into account."""
        if isinstance(event, OdometryMatched):
            self.motions += 1
        if isinstance(event, LandmarksPerceived):
            self._add_sweep(event)

    def _add_sweep(self, event: LandmarksPerceived) -> None:
        self.sweeps += 1
        self.sights += len(event.landmarks)
        self.things |= {(event.sensor, one.kind, one.track) for one in event.landmarks}
        if event.refusal:
            reason = reason_of(event.refusal)
            self.refused[reason] = self.refused.get(reason, 0) + 1

    def things_of(self, kind: str) -> int:
        """How many things of a kind were told of."""
        return sum(each[1] == kind for each in self.things)


class Spoken:
    """What stands in the log of each of perception's boots, so that nothing is said twice and numbers go on.

    An event is known by its sweep and its kind: who begins in the middle of a drive need not tell the same again to the
    last digit.
    """

    def __init__(self, counts: Mapping[str, int]) -> None:
        """`counts`: events of each boot that are not told of again."""
        self._counts = dict(counts)
        self._there: dict[str, set[tuple[int, type]]] = {}

    @property
    def counts(self) -> Mapping[str, int]:
        """How many events there are of each boot."""
        return dict(self._counts)

    def add(self, row: Envelope[SweepPerceived]) -> None:
        """One that is in the log and may be told of again."""
        boot_id = row.identity.boot_id
        self._counts[boot_id] = max(self._counts.get(boot_id, 0), row.identity.sequence + 1)
        self._there.setdefault(boot_id, set()).add((row.event.sweep_sequence, type(row.event)))

    def sweeps(self, boot_id: str) -> int:
        """How many sweeps of a boot were told of, of those that may be again."""
        return sum(kind is LandmarksPerceived for _, kind in self._there.get(boot_id, ()))

    def forget(self, boot_id: str) -> None:
        """A boot of which nothing is told again."""
        self._there.pop(boot_id, None)

    def fresh(
        self, told: Iterable[tuple[int, SweepPerceived]], *, boot_id: str
    ) -> tuple[Envelope[SweepPerceived], ...]:
        """Those of the events that are not in the log, with their stamps and numbered on; they count as there."""
        there = self._there.get(boot_id, set())
        new = []
        for one in told:
            name = (one[1].sweep_sequence, type(one[1]))
            if name in there:
                there.remove(name)  # nobody tells it a third time
            else:
                new.append(one)
        first = self._counts.get(boot_id, 0)
        self._counts[boot_id] = first + len(new)
        return numbered(new, boot_id=boot_id, first_sequence=first)
