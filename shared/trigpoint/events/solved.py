"""One whole map version as a value: what the optimiser returns, and what a log's mapped events fold back into."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.envelope import Envelope
from trigpoint.events.mapped import (
    AnchorAssociated,
    ImageOffsetSolved,
    LabelGainSolved,
    LandmarkSolved,
    Mapped,
    MapSolved,
    TrajectorySolved,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class SolvedMap:
    """A map version: its head and all its parts."""

    head: MapSolved
    trajectories: tuple[TrajectorySolved, ...]
    landmarks: tuple[LandmarkSolved, ...]
    anchors: tuple[AnchorAssociated, ...]
    images: tuple[ImageOffsetSolved, ...]
    gains: tuple[LabelGainSolved, ...] = ()

    def events(self) -> tuple[Mapped, ...]:
        """All events of the version in the order they are appended: the head last."""
        return (*self.trajectories, *self.landmarks, *self.anchors, *self.images, *self.gains, self.head)


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelReduction:
    """Everything but the anchors, marginalised onto the labelled landmarks: a Gaussian in information form.

    With dx (2m,) = landmark positions minus `point_m` (m, 2), x and y of each landmark in turn, the cost is
    1/2 dx' information dx - gradient' dx; information (2m, 2m) may be singular where only anchors fix the frame.
    Labels (l,): `landmark_index` says which landmark each label is tied to, `label_m` (l, 2) its position in the
    map frame, `sigma_m` (l,) its 1-sigma per axis, `image_index` (l,) its image or -1 for a survey.
    Images (k,): `image_sigma_m` the prior 1-sigma per axis of each one's offset (label minus true position).
    """

    landmarks: tuple[str, ...]
    point_m: Floats
    information: Floats
    gradient: Floats
    labels: tuple[str, ...]
    landmark_index: Ints
    label_m: Floats
    sigma_m: Floats
    image_index: Ints
    images: tuple[str, ...]
    image_sigma_m: Floats


def own_events(closing: Envelope[Mapped], pending: Iterable[Envelope[Mapped]]) -> tuple[Mapped, ...]:
    """Of the events since the last MapSolved those of the version this one closes: of its number, from the same boot of
    the writer. The others are what a solve left whose writing was cut off; its number is given anew."""
    writer = (closing.identity.source, closing.identity.boot_id, closing.event.map_version)
    return tuple(
        row.event for row in pending if (row.identity.source, row.identity.boot_id, row.event.map_version) == writer
    )


def closed_versions(rows: Iterable[Envelope[Mapped]]) -> Iterator[tuple[MapSolved, tuple[Mapped, ...]]]:
    """The head and the other events of each complete version, in the order of the log."""
    pending: list[Envelope[Mapped]] = []
    for row in rows:
        if isinstance(row.event, MapSolved):
            yield row.event, own_events(row, pending)
            pending = []
        else:
            pending.append(row)


def solved_maps(events: Iterable[Mapped]) -> tuple[SolvedMap, ...]:
    """The complete map versions in a sequence of mapped events, each whole; parts without a head are left out, and so
    is a version whose base is not there."""
    parts: dict[int, list[Mapped]] = {}
    heads: dict[int, MapSolved] = {}
    for event in events:
        if isinstance(event, MapSolved):
            heads[event.map_version] = event
        else:
            parts.setdefault(event.map_version, []).append(event)
    whole: dict[int, SolvedMap] = {}
    for version in sorted(heads):
        solved = _assembled(heads[version], parts.get(version, []))
        if not solved.head.base_version:
            whole[version] = solved
        elif solved.head.base_version in whole:
            whole[version] = _upon(whole[solved.head.base_version], solved)
    return tuple(whole.values())


def _upon(base: SolvedMap, change: SolvedMap) -> SolvedMap:
    """A version that says only what differs from its base, made whole with what the base has."""
    paths = {(one.vehicle, one.boot_id): one for one in (*base.trajectories, *change.trajectories)}
    landmarks = {one.landmark: one for one in base.landmarks}
    landmarks |= {one.landmark: seen_more(landmarks.get(one.landmark), one) for one in change.landmarks}
    removed = set(change.head.removed)
    return SolvedMap(
        head=change.head,
        trajectories=tuple(paths.values()),
        landmarks=tuple(one for name, one in landmarks.items() if name not in removed),
        anchors=tuple({(one.anchor, one.image): one for one in (*base.anchors, *change.anchors)}.values()),
        images=tuple({one.image: one for one in (*base.images, *change.images)}.values()),
        gains=change.gains or base.gains,
    )


def seen_more(before: LandmarkSolved | None, landmark: LandmarkSolved) -> LandmarkSolved:
    """A landmark of a version upon another, which has the observations since, with those before."""
    if before is None:
        return landmark
    return replace(landmark, observations=tuple(dict.fromkeys((*before.observations, *landmark.observations))))


def _assembled(head: MapSolved, parts: list[Mapped]) -> SolvedMap:
    return SolvedMap(
        head=head,
        trajectories=tuple(part for part in parts if isinstance(part, TrajectorySolved)),
        landmarks=tuple(part for part in parts if isinstance(part, LandmarkSolved)),
        anchors=tuple(part for part in parts if isinstance(part, AnchorAssociated)),
        images=tuple(part for part in parts if isinstance(part, ImageOffsetSolved)),
        gains=tuple(part for part in parts if isinstance(part, LabelGainSolved)),
    )
