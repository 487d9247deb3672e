"""Whole map versions out of the optimiser's events: what is not closed by its MapSolved is not there."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from trigpoint.events.envelope import Envelope, LogPosition
from trigpoint.events.mapped import (
    AnchorAssociated,
    ImageOffsetSolved,
    LandmarkSolved,
    Mapped,
    MapSolved,
    TrajectorySolved,
)
from trigpoint.events.solved import own_events

T = TypeVar("T", TrajectorySolved, LandmarkSolved, AnchorAssociated, ImageOffsetSolved)
Logged = tuple[LogPosition, Envelope[Mapped]]


@dataclass(frozen=True, slots=True, kw_only=True)
class SolvedVersion:
    """The events of one map version; `position` and `stamp_ns` are those of the MapSolved that closed it."""

    position: LogPosition
    stamp_ns: int
    solved: MapSolved
    landmarks: tuple[LandmarkSolved, ...]
    trajectories: tuple[TrajectorySolved, ...]
    anchors: tuple[AnchorAssociated, ...]
    image_offsets: tuple[ImageOffsetSolved, ...]


class OpenVersion:
    """The events since the last MapSolved: those of a version that is not closed yet.

    A version is made of the events of its number from the same boot of the writer as its MapSolved. Events before
    a MapSolved that are not its own belong to a solve that was cut off, and are dropped. What a writer says twice
    counts once, as it said it last.
    """

    def __init__(self) -> None:
        self._pending: list[Envelope[Mapped]] = []

    def after(self, position: LogPosition, envelope: Envelope[Mapped]) -> SolvedVersion | None:
        """The version the next event of the log closes, None if it closes none."""
        if not isinstance(envelope.event, MapSolved):
            self._pending.append(envelope)
            return None
        pending, self._pending = self._pending, []
        return _closed(position, envelope, envelope.event, pending)


def solved_versions(rows: Iterable[Logged]) -> Iterator[SolvedVersion]:
    """The versions closed in a stream of events in order of the log."""
    version = OpenVersion()
    closed = (version.after(position, envelope) for position, envelope in rows)
    return (one for one in closed if one is not None)


def refusal_of(version: SolvedVersion, *, newest: int, valid: Collection[str]) -> str:
    """Why a version cannot be taken in after version `newest`, whose landmarks are `valid`, or an empty text."""
    solved = version.solved
    if solved.map_version <= newest:
        return f"map version {solved.map_version} does not come after {newest}"
    if solved.base_version not in (0, newest):
        return f"map version {solved.map_version} is a change of {solved.base_version}: {newest} is held"
    count = landmark_count(version, valid)
    if solved.landmark_count != count:
        return f"MapSolved counts {solved.landmark_count} landmarks: {count} are in the log"
    if any("\0" in text for text in _texts(version)):
        return "a name or text has the character U+0000, which no database keeps"
    return _infinity_of(version.landmarks)


def _texts(version: SolvedVersion) -> Iterator[str]:
    """Everything of a version that a database keeps as text just as it is."""
    for landmark in version.landmarks:
        yield from (landmark.landmark, landmark.kind, landmark.signature)
    for path in version.trajectories:
        yield from (path.vehicle, path.boot_id)
    for anchor in version.anchors:
        yield from (anchor.anchor, anchor.image, anchor.landmark, anchor.reason)
    yield from (offset.image for offset in version.image_offsets)
    yield from (version.solved.method, version.solved.settings_json)


def landmark_count(version: SolvedVersion, valid: Collection[str]) -> int:
    """How many landmarks the map has with this version, where the version before has `valid`."""
    if not version.solved.base_version:
        return len(version.landmarks)
    removed = set(version.solved.removed)
    added = sum(row.landmark not in valid for row in version.landmarks if row.landmark not in removed)
    return len(valid) + added - sum(name in valid for name in removed)


def _infinity_of(landmarks: Sequence[LandmarkSolved]) -> str:
    values = np.array([(*row.position_m.flat, *row.covariance_m2.flat) for row in landmarks], dtype=np.float64)
    finite = np.isfinite(values).all(axis=-1) if len(values) else np.empty(0)
    if finite.all():
        return ""
    return f"landmark {landmarks[int(np.argmin(finite))].landmark!r} has a position or covariance that is not finite"


def _closed(
    position: LogPosition, closing: Envelope[Mapped], solved: MapSolved, pending: list[Envelope[Mapped]]
) -> SolvedVersion:
    events = own_events(closing, pending)
    return SolvedVersion(
        position=position,
        stamp_ns=closing.stamp_ns,
        solved=solved,
        landmarks=tuple({row.landmark: row for row in _of(events, LandmarkSolved)}.values()),
        trajectories=tuple({(row.vehicle, row.boot_id): row for row in _of(events, TrajectorySolved)}.values()),
        anchors=tuple({(row.anchor, row.image): row for row in _of(events, AnchorAssociated)}.values()),
        image_offsets=tuple({row.image: row for row in _of(events, ImageOffsetSolved)}.values()),
    )


def _of(events: Iterable[Mapped], kind: type[T]) -> Iterator[T]:
    return (event for event in events if isinstance(event, kind))
