"""What came of the messages: counted by vehicle, and by reason where one was refused."""

from collections import Counter
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleCounts:
    """One vehicle's messages; `refused` counts them by reason, sorted."""

    vehicle: str
    accepted: int
    duplicates: int
    refused: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class DamagedFile:
    """A file that could not be read to its end, and what of it was lost."""

    path: str
    detail: str


@dataclass(frozen=True, slots=True, kw_only=True)
class IngestReport:
    """What came of everything ingested: by vehicle, sorted by name, and the files with damage."""

    vehicles: tuple[VehicleCounts, ...]
    damaged: tuple[DamagedFile, ...]

    @property
    def accepted(self) -> int:
        """Events new in the log."""
        return sum(counts.accepted for counts in self.vehicles)

    @property
    def duplicates(self) -> int:
        """Messages the log had already."""
        return sum(counts.duplicates for counts in self.vehicles)

    @property
    def refused(self) -> tuple[tuple[str, int], ...]:
        """Refused messages of all vehicles by reason, sorted."""
        total: Counter[str] = Counter()
        for counts in self.vehicles:
            total.update(dict(counts.refused))
        return tuple(sorted(total.items()))

    def complaints(self) -> tuple[str, ...]:
        """One line for each file with damage and for each vehicle and reason of refusal; empty if all went in."""
        files = [f"{damaged.path}: {damaged.detail}" for damaged in self.damaged]
        refusals = [
            f"vehicle {counts.vehicle!r}: {count} messages refused, {reason}"
            for counts in self.vehicles
            for reason, count in counts.refused
        ]
        return (*files, *refusals)


@dataclass(slots=True)
class Tally:
    """Counts while they grow."""

    accepted: Counter[str] = field(default_factory=Counter)
    duplicates: Counter[str] = field(default_factory=Counter)
    refused: Counter[tuple[str, str]] = field(default_factory=Counter)
    damaged: list[DamagedFile] = field(default_factory=list)

    def report(self) -> IngestReport:
        """The counts as they are now."""
        vehicles = sorted({*self.accepted, *self.duplicates, *(vehicle for vehicle, _ in self.refused)})
        return IngestReport(vehicles=tuple(self._counts(vehicle) for vehicle in vehicles), damaged=tuple(self.damaged))

    def _counts(self, vehicle: str) -> VehicleCounts:
        refused = {reason: count for (owner, reason), count in self.refused.items() if owner == vehicle}
        return VehicleCounts(
            vehicle=vehicle,
            accepted=self.accepted[vehicle],
            duplicates=self.duplicates[vehicle],
            refused=tuple(sorted(refused.items())),
        )
