"""Whole map versions out of the optimiser's events: what is not closed by its MapSolved is not there."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.codec import schema_name
from trigpoint.events.envelope import Envelope, LogPosition
from trigpoint.events.mapped import (
    AnchorAssociated,
    ImageOffsetSolved,
    LabelGainSolved,
    LandmarkSolved,
    Mapped,
    MapSolved,
    TrajectorySolved,
)
from trigpoint.events.runs import EncodedRun, LoggedRun, envelopes
from trigpoint.events.solved import own_events
from trigpoint.events.solved_landmarks import LandmarkDecoder, SolvedLandmarks

HEAD_SCHEMA, LANDMARK_SCHEMA = schema_name(MapSolved), schema_name(LandmarkSolved)

T = TypeVar("T", TrajectorySolved, AnchorAssociated, ImageOffsetSolved, LabelGainSolved)
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class SolvedVersion:
    """The events of one map version; `position` and `stamp_ns` are those of the MapSolved that closed it."""

    position: LogPosition
    stamp_ns: int
    solved: MapSolved
    landmarks: SolvedLandmarks
    trajectories: tuple[TrajectorySolved, ...]
    anchors: tuple[AnchorAssociated, ...]
    image_offsets: tuple[ImageOffsetSolved, ...]
    label_gains: tuple[LabelGainSolved, ...] = ()


class OpenVersion:
    """The events since the last MapSolved: those of a version that is not closed yet.

    A version is made of the events of its number from the same boot of the writer as its MapSolved. Events before
    a MapSolved that are not its own belong to a solve that was cut off, and are dropped. What a writer says twice
    counts once, as it said it last. Events are decoded when their version is closed.
    """

    def __init__(self) -> None:
        self._pending: list[EncodedRun] = []
        self._decoder = LandmarkDecoder()

    def after(self, logged: LoggedRun) -> Iterator[SolvedVersion]:
        """The versions the next events of the log close, in order. Raises EventRejected for an event of one of them
        that cannot be decoded; the versions before it are told before."""
        start = 0
        for row in _rows_of(logged.run, HEAD_SCHEMA).tolist():
            pending, self._pending = [*self._pending, logged.run.part(start, row)], []
            start = row + 1
            (closing,) = envelopes(logged.run.part(row, start))
            position = LogPosition(logged.position.stream, logged.position.number + row)
            yield self._closed(position, cast(Envelope[MapSolved], closing), pending)
        self._pending.append(logged.run.part(start, len(logged.run)))

    def _closed(
        self, position: LogPosition, closing: Envelope[MapSolved], pending: Sequence[EncodedRun]
    ) -> SolvedVersion:
        writer = (closing.identity.source, closing.identity.boot_id)
        runs = [run for run in pending if (run.source, run.boot_id) == writer]
        others = own_events(closing, _other_events(runs))
        return SolvedVersion(
            position=position,
            stamp_ns=closing.stamp_ns,
            solved=closing.event,
            landmarks=self._landmarks(runs, closing.event.map_version),
            trajectories=tuple({(row.vehicle, row.boot_id): row for row in _of(others, TrajectorySolved)}.values()),
            anchors=tuple({(row.anchor, row.image): row for row in _of(others, AnchorAssociated)}.values()),
            image_offsets=tuple({row.image: row for row in _of(others, ImageOffsetSolved)}.values()),
            label_gains=tuple({row.image: row for row in _of(others, LabelGainSolved)}.values()),
        )

    def _landmarks(self, runs: Sequence[EncodedRun], map_version: int) -> SolvedLandmarks:
        """The landmarks of the version among the events of its writer, each as it was said last."""
        said = [run.picked(_rows_of(run, LANDMARK_SCHEMA)).payloads for run in runs]
        solved = self._decoder.decoded([payload for payloads in said for payload in payloads])
        own = solved.picked(np.flatnonzero(solved.map_versions == map_version))
        last = {name: row for row, name in enumerate(own.landmarks)}
        return own if len(last) == len(own) else own.picked(np.array(list(last.values()), dtype=np.int64))


def solved_versions(rows: Iterable[LoggedRun]) -> Iterator[SolvedVersion]:
    """The versions closed in a stream of events in order of the log."""
    version = OpenVersion()
    return (closed for row in rows for closed in version.after(row))


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
    yield from version.landmarks.landmarks
    yield from version.landmarks.kinds
    yield from version.landmarks.signatures
    for path in version.trajectories:
        yield from (path.vehicle, path.boot_id)
    for anchor in version.anchors:
        yield from (anchor.anchor, anchor.image, anchor.landmark, anchor.reason)
    yield from (offset.image for offset in version.image_offsets)
    yield from (gain.image for gain in version.label_gains)
    yield from (version.solved.method, version.solved.settings_json)


def landmark_count(version: SolvedVersion, valid: Collection[str]) -> int:
    """How many landmarks the map has with this version, where the version before has `valid`."""
    if not version.solved.base_version:
        return len(version.landmarks)
    removed = set(version.solved.removed)
    added = sum(name not in valid for name in version.landmarks.landmarks if name not in removed)
    return len(valid) + added - sum(name in valid for name in removed)


def _infinity_of(solved: SolvedLandmarks) -> str:
    finite = np.isfinite(solved.positions_m).all(axis=1) & np.isfinite(solved.covariances_m2).all(axis=(1, 2))
    if finite.all():
        return ""
    return f"landmark {solved.landmarks[int(np.argmin(finite))]!r} has a position or covariance that is not finite"


def _rows_of(run: EncodedRun, schema: str) -> Integers:
    """The numbers of a run's rows of a schema."""
    if schema not in run.schemas:
        return np.empty(0, dtype=np.int64)
    return np.asarray(np.flatnonzero(run.schema_of_row == run.schemas.index(schema)))


def _other_events(runs: Iterable[EncodedRun]) -> Iterator[Envelope[Mapped]]:
    """All but the landmarks."""
    for run in runs:
        others = [row for schema in run.schemas if schema != LANDMARK_SCHEMA for row in _rows_of(run, schema).tolist()]
        for envelope in envelopes(run.picked(np.array(sorted(others), dtype=np.int64))):
            yield cast(Envelope[Mapped], envelope)


def _of(events: Iterable[Mapped], kind: type[T]) -> Iterator[T]:
    return (event for event in events if isinstance(event, kind))
