"""Map versions taken from the log into one store, many in one transaction."""

from collections.abc import Callable, Iterator, Mapping
from typing import cast

from trigpoint.events.corrected import AnchorLabelled, Corrected
from trigpoint.events.envelope import Envelope, LogPosition
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.mapped import (
    AnchorAssociated,
    ImageOffsetSolved,
    LandmarkSolved,
    Mapped,
    MapSolved,
    TrajectorySolved,
)
from trigpoint.geodesy.projection import MapFrame
from trigpoint.landmarks.model import Landmark, MapChange
from trigpoint.landmarks.ports import LandmarkStore
from trigpoint.landmarks.queries import LandmarkQuery
from trigpoint.logs.following import StreamFollower
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import logged_frame
from trigpoint_landmarks.core.rows import labels_within, make_valid, map_change
from trigpoint_landmarks.core.versions import OpenVersion, SolvedVersion, refusal_of

MAP_STREAM = STREAM_PATTERNS[MapSolved]
LABEL_STREAM = STREAM_PATTERNS[AnchorLabelled]
KINDS = (AnchorAssociated, ImageOffsetSolved, LandmarkSolved, MapSolved, TrajectorySolved)

Inputs = tuple[tuple[str, int], ...]
Labels = Mapping[tuple[str, str], AnchorLabelled]
Refused = Callable[[int, str], None]


class Projector:
    """Follows the optimiser's stream from the store's checkpoint on; what it knows of the store is read once.

    A version whose events are not whole is refused, with the reason; the next one goes on.
    """

    def __init__(self, log: EventLog, store: LandmarkStore, *, refused: Refused) -> None:
        self._log, self._store, self._refused = log, store, refused
        self._checkpoint = store.checkpoint()
        self._valid: dict[str, Landmark] = {row.landmark: row for row in store.landmarks(LandmarkQuery())}
        self._newest = max((version.map_version for version in store.map_versions()), default=0)
        held = {MAP_STREAM: self._checkpoint.next_number(MAP_STREAM)}
        self._follower = StreamFollower(log, (MAP_STREAM,), checkpoint=held, kinds=KINDS)
        self._open = OpenVersion()
        self._frame: MapFrame | None = None
        self._labels: tuple[Inputs, Labels] = ((), {})

    @property
    def map_version(self) -> int:
        """The newest version in the store, 0 before the first."""
        return self._newest

    @property
    def landmark_count(self) -> int:
        """How many landmarks the newest version has."""
        return len(self._valid)

    @property
    def lag_events(self) -> int:
        """How many events stand in the log that were not taken."""
        return self._follower.lag

    def take(self, limit: int) -> tuple[int, tuple[int, ...]]:
        """How many of the next events were taken, at most `limit`, and the versions that are in the store by them.

        Raises InputError if versions are there and no frame is pinned, LogDamaged, and ServiceError from the store;
        after any of these the store is as it was, and this projector of no more use.
        """
        rows = self._follower.take(limit)
        changes: list[MapChange] = []
        checkpoint = self._checkpoint
        for row in rows:
            version = self._open.after(row.position, cast(Envelope[Mapped], row.envelope))
            if version is not None and self._is_taken(version):
                changes.append(self._change_of(version))
                checkpoint = checkpoint.after(version.position)
        if changes:
            self._store.apply_all(changes, checkpoint)
            self._checkpoint = checkpoint
        return len(rows), tuple(change.version.map_version for change in changes)

    def _is_taken(self, version: SolvedVersion) -> bool:
        reason = refusal_of(version, newest=self._newest, valid=self._valid)
        if reason:
            self._refused(version.solved.map_version, reason)
        return not reason

    def _change_of(self, version: SolvedVersion) -> MapChange:
        self._frame = self._frame or logged_frame(self._log)
        labels = self._labels_of(version.solved.inputs) if version.anchors else {}
        change = map_change(version, frame=self._frame, labels=labels, valid=self._valid)
        make_valid(self._valid, change)
        self._newest = version.solved.map_version
        return change

    def _labels_of(self, inputs: Inputs) -> Labels:
        """The labels a version's solve could know; looked up anew only where it read more of them than the last one."""
        known = tuple((stream, count) for stream, count in inputs if stream == LABEL_STREAM)
        if known != self._labels[0]:
            self._labels = (known, labels_within(_corrections(self._log), known))
        return self._labels[1]


def _corrections(log: EventLog) -> Iterator[tuple[LogPosition, Corrected]]:
    for logged in log.read(LABEL_STREAM):
        if isinstance(logged.envelope.event, Corrected):
            yield logged.position, logged.envelope.event
