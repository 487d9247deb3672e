"""How anchors and drives stand after all corrections: what holds, what was taken back, by whom and why."""

from collections.abc import Iterable
from dataclasses import dataclass

from trigpoint.events.corrected import AnchorLabelled, AnchorRetracted, Corrected, DriveExcluded, DriveIncluded


@dataclass(frozen=True, slots=True, kw_only=True)
class AnchorStanding:
    """An anchor as it was labelled last, and its retraction if it does not hold."""

    label: AnchorLabelled
    retracted: AnchorRetracted | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveStanding:
    """A drive in the log, all of it within [start_ns, end_ns], and what was last said of its part in the map."""

    vehicle: str
    boot_id: str
    start_ns: int
    end_ns: int
    corrected: DriveExcluded | DriveIncluded | None = None

    @property
    def excluded(self) -> bool:
        """Whether the map is solved without it."""
        return isinstance(self.corrected, DriveExcluded)


def anchor_standings(corrections: Iterable[Corrected]) -> tuple[AnchorStanding, ...]:
    """Every anchor ever labelled, by name and image, from all corrections in order of appending."""
    standings: dict[tuple[str, str], AnchorStanding] = {}
    for one in corrections:
        if isinstance(one, AnchorLabelled):
            standings[one.anchor, one.image] = AnchorStanding(label=one)
        elif isinstance(one, AnchorRetracted) and (one.anchor, one.image) in standings:
            label = standings[one.anchor, one.image].label
            standings[one.anchor, one.image] = AnchorStanding(label=label, retracted=one)
    return tuple(standings.values())


def drive_corrections(corrections: Iterable[Corrected]) -> dict[tuple[str, str], DriveExcluded | DriveIncluded]:
    """What was last said of each drive, by vehicle and boot, from all corrections in order of appending."""
    return {(one.vehicle, one.boot_id): one for one in corrections if isinstance(one, DriveExcluded | DriveIncluded)}
