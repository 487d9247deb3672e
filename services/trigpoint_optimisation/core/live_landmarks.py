"""The landmarks of a live map: what is known of each besides where it is."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from hashlib import blake2b

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.mapped import LandmarkSolved
from trigpoint_optimisation.core.live_tracks import Seen, Track

Floats = NDArray[np.float64]

UNNUMBERED = 0  # a map version until the log gives it its number


@dataclass(slots=True)
class LiveLandmark:
    """One landmark: its name, what it is, and every sweep that saw it; `said` is how it was told of last."""

    name: str
    kind: str
    signature: str
    count: int = 0
    vehicles: set[str] = field(default_factory=set)
    first_ns: int = 0
    last_ns: int = 0
    anchors: tuple[str, ...] = ()
    observations: dict[tuple[str, str, int], None] = field(default_factory=dict)
    said: LandmarkSolved | None = None

    def take(self, track: Track, seen: Sequence[Seen], *, vehicle: str, boot_id: str) -> None:
        """More detections, of one track."""
        self.first_ns = min(self.first_ns, track.first_ns) if self.count else track.first_ns
        self.last_ns = max(self.last_ns, track.last_ns)
        self.count += len(seen)
        self.vehicles.add(vehicle)
        self.observations |= dict.fromkeys((vehicle, boot_id, each.sequence) for each in seen)

    def solved(self, position_m: Floats, covariance_m2: Floats) -> LandmarkSolved:
        """It as an event of version UNNUMBERED."""
        return LandmarkSolved(
            map_version=UNNUMBERED,
            landmark=self.name,
            kind=self.kind,
            signature=self.signature,
            position_m=position_m,
            covariance_m2=covariance_m2,
            observation_count=self.count,
            vehicles=tuple(sorted(self.vehicles)),
            first_seen_ns=self.first_ns,
            last_seen_ns=self.last_ns,
            anchors=self.anchors,
            observations=tuple(self.observations),
        )


def landmark_of(event: LandmarkSolved) -> LiveLandmark:
    """A landmark of a map version, to be seen again."""
    return LiveLandmark(
        name=event.landmark,
        kind=event.kind,
        signature=event.signature,
        count=event.observation_count,
        vehicles=set(event.vehicles),
        first_ns=event.first_seen_ns,
        last_ns=event.last_seen_ns,
        anchors=event.anchors,
        observations=dict.fromkeys(event.observations),
        said=event,
    )


def detected_name(vehicle: str, boot_id: str, *, sequence: int, row: int) -> str:
    """A landmark's name by its first detection: the same in every version that starts from it."""
    return "lm-" + blake2b(f"{vehicle}/{boot_id}/{sequence}/{row}".encode(), digest_size=6).hexdigest()


def unused_name(name: str, used: Iterable[str]) -> str:
    """The name, or where it is taken the name with the first number that makes it another."""
    taken, number, free = set(used), 1, name
    while free in taken:
        number, free = number + 1, f"{name}-{number + 1}"
    return free
