"""The landmarks of a live map: what is known of each besides where it is."""

from collections.abc import Container, Sequence
from dataclasses import dataclass, field
from hashlib import blake2b

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.mapped import LandmarkSolved
from trigpoint_optimisation.core.live_tracks import Seen, Track

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SURER = 0.7  # of the variance told: a landmark that is known better by more is told of again
UNNUMBERED = 0  # a map version until the log gives it its number


@dataclass(slots=True)
class LiveLandmark:
    """One landmark: its name, what it is, and every sweep that saw it since it was told of."""

    name: str
    kind: str
    signature: str
    count: int = 0
    vehicles: set[str] = field(default_factory=set)
    first_ns: int = 0
    last_ns: int = 0
    anchors: tuple[str, ...] = ()
    observations: dict[tuple[str, str, int], None] = field(default_factory=dict)

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
    )


def detected_name(vehicle: str, boot_id: str, *, sequence: int, row: int) -> str:
    """A landmark's name by its first detection: the same in every version that starts from it."""
    return "lm-" + blake2b(f"{vehicle}/{boot_id}/{sequence}/{row}".encode(), digest_size=6).hexdigest()


class LiveLandmarks:
    """All landmarks of a live map by number, where they are as far as that was asked for, and how they were told of
    last."""

    def __init__(self, base: Sequence[LandmarkSolved]) -> None:
        self.all: list[LiveLandmark] = []
        self._point_m = np.zeros((64, 2))
        self._said_m, self._said_m2 = np.zeros((64, 2)), np.full((64, 2, 2), np.nan)  # NaN: never
        self._names: set[str] = set()
        self._signed: dict[str, list[int]] = {}
        for event in base:
            self._say(self._take(landmark_of(event), event.position_m), event)

    @property
    def point_m(self) -> Floats:
        """Where they are (n, 2); to be written to."""
        return self._point_m[: len(self.all)]

    @property
    def kind(self) -> tuple[str, ...]:
        """What each is."""
        return tuple(landmark.kind for landmark in self.all)

    def add(self, name: str, point_m: Floats, *, kind: str, signature: str) -> int:
        """The number of a new landmark at (2,); it has its signature for a name, or a name that no other has."""
        free = signature or unused_name(name, self._names)
        return self._take(LiveLandmark(name=free, kind=kind, signature=signature), point_m)

    def signed(self, signature: str) -> Sequence[int]:
        """Those with this signature."""
        return self._signed.get(signature, ())

    @property
    def told_count(self) -> int:
        """How many were told of."""
        return int(np.isfinite(self._said_m2[: len(self.all), 0, 0]).sum())

    def moved_sigmas(self) -> Floats:
        """How far each (n,) is from where it was told to be, in sigmas told; infinite where it never was."""
        many = len(self.all)
        off_m = np.hypot(*(self.point_m - self._said_m[:many]).T)
        sigma_m = np.sqrt(0.5 * np.trace(self._said_m2[:many], axis1=1, axis2=2))
        return np.where(np.isfinite(sigma_m), off_m / sigma_m, np.inf)

    def is_surer(self, number: int, covariance_m2: Floats) -> bool:
        """Whether a landmark told of is known clearly better now."""
        return float(np.trace(covariance_m2)) < SURER * float(np.trace(self._said_m2[number]))

    def told(self, number: int, covariance_m2: Floats | None) -> LandmarkSolved:
        """A landmark as an event of version UNNUMBERED, with the covariance told last where there is none: from now on
        it is told of so."""
        if covariance_m2 is None:
            covariance_m2 = self._said_m2[number].copy()
        event = self.all[number].solved(self.point_m[number].copy(), covariance_m2)
        self._say(number, event)
        return event

    def _say(self, number: int, event: LandmarkSolved) -> None:
        self.all[number].observations.clear()
        self._said_m[number], self._said_m2[number] = event.position_m, event.covariance_m2

    def within(self, at_m: Floats, reach_m: float) -> Ints:
        """Those within so many m of a point (2,), the nearest first."""
        away_m = np.hypot(*(self.point_m - at_m).T)
        near = np.nonzero(away_m <= reach_m)[0]
        found: Ints = near[np.argsort(away_m[near], kind="stable")]
        return found

    def _take(self, landmark: LiveLandmark, point_m: Floats) -> int:
        number = len(self.all)
        if number == len(self._point_m):
            self._point_m = np.vstack([self._point_m, np.zeros_like(self._point_m)])
            self._said_m = np.vstack([self._said_m, np.zeros_like(self._said_m)])
            self._said_m2 = np.vstack([self._said_m2, np.full((number, 2, 2), np.nan)])
        self._point_m[number] = point_m
        self.all.append(landmark)
        self._names.add(landmark.name)
        if landmark.signature:
            self._signed.setdefault(landmark.signature, []).append(number)
        return number


def unused_name(name: str, used: Container[str]) -> str:
    """The name, or where it is taken the name with the first number that makes it another."""
    number, free = 1, name
    while free in used:
        number, free = number + 1, f"{name}-{number + 1}"
    return free
