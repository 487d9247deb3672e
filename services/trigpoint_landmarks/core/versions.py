"""Whole map versions out of the optimiser's events: what is not closed by its MapSolved is not there."""

from collections.abc import Iterable, Iterator
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


def solved_versions(rows: Iterable[Logged]) -> Iterator[SolvedVersion]:
    """The versions closed in a stream of events in order of the log.

    A version is made of the events of its number from the same boot of the writer as its MapSolved. Events before
    a MapSolved that are not its own belong to a solve that was cut off, and are dropped. What a writer says twice
    counts once, as it said it last.
    """
    pending: list[Envelope[Mapped]] = []
    for position, envelope in rows:
        if isinstance(envelope.event, MapSolved):
            yield _closed(position, envelope, envelope.event, pending)
            pending = []
        else:
            pending.append(envelope)


def refusal_of(version: SolvedVersion, *, newest: int) -> str:
    """Why a version cannot be taken in after version `newest`, or an empty text."""
    solved = version.solved
    if solved.map_version <= newest:
        return f"map version {solved.map_version} does not come after {newest}"
    if solved.landmark_count != len(version.landmarks):
        return f"MapSolved counts {solved.landmark_count} landmarks: {len(version.landmarks)} are in the log"
    broken = [row.landmark for row in version.landmarks if not _is_finite(row)]
    if broken:
        return f"landmark {broken[0]!r} has a position or covariance that is not finite"
    return ""


def _is_finite(row: LandmarkSolved) -> bool:
    return bool(np.isfinite(row.position_m).all() and np.isfinite(row.covariance_m2).all())


def _closed(
    position: LogPosition, closing: Envelope[Mapped], solved: MapSolved, pending: list[Envelope[Mapped]]
) -> SolvedVersion:
    writer = (closing.identity.source, closing.identity.boot_id, solved.map_version)
    events = [
        row.event for row in pending if (row.identity.source, row.identity.boot_id, row.event.map_version) == writer
    ]
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
