"""Map versions taken from the log into one store, many in one transaction."""

import gc
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass

from trigpoint.errors import EventRejected, FrameRefused
from trigpoint.events.corrected import AnchorLabelled, Corrected
from trigpoint.events.envelope import LogPosition
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.mapped import (
    AnchorAssociated,
    ImageOffsetSolved,
    LabelGainSolved,
    LandmarkSolved,
    MapSolved,
    TrajectorySolved,
)
from trigpoint.geodesy.projection import MapFrame
from trigpoint.landmarks.model import Landmark, MapChange
from trigpoint.landmarks.ports import LandmarkStore
from trigpoint.landmarks.queries import LandmarkQuery
from trigpoint.logs.following import RunFollower
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import logged_frame
from trigpoint_landmarks.core.rows import held, labels_within, make_valid, map_change
from trigpoint_landmarks.core.versions import OpenVersion, SolvedVersion, refusal_of

MAP_STREAM = STREAM_PATTERNS[MapSolved]
LABEL_STREAM = STREAM_PATTERNS[AnchorLabelled]
KINDS = (AnchorAssociated, ImageOffsetSolved, LabelGainSolved, LandmarkSolved, MapSolved, TrajectorySolved)
BATCH_BYTES = 32 * 1024 * 1024  # of payloads, which take some times that while they become rows

Inputs = tuple[tuple[str, int], ...]
Labels = Mapping[tuple[str, str], AnchorLabelled]
Refused = Callable[[int, str], None]


@dataclass(frozen=True, slots=True)
class _Batch:
    """So many events up to before `next_number`, and the versions they close."""

    count: int
    next_number: int
    versions: tuple[SolvedVersion, ...]


class Projector:
    """Follows the optimiser's stream from the store's checkpoint on; what it knows of the store is read once.

    A version whose events are not whole is refused, with the reason; the next one goes on. Close it.
    """

    def __init__(self, log: EventLog, store: LandmarkStore, *, refused: Refused) -> None:
        self._log, self._store, self._refused = log, store, refused
        self._checkpoint = store.checkpoint()
        self._valid: dict[str, Landmark] = {row.landmark: held(row) for row in store.landmarks(LandmarkQuery())}
        self._newest = max((version.map_version for version in store.map_versions()), default=0)
        self.next_number = self._checkpoint.next_number(MAP_STREAM)  # of the first event not taken
        self._follower = RunFollower(log, MAP_STREAM, first_number=self.next_number, kinds=KINDS)
        self._reader = ThreadPoolExecutor(max_workers=1, thread_name_prefix="reading-ahead")
        self._ahead: Future[_Batch] | None = None
        self._open = OpenVersion()
        self._error: EventRejected | None = None
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
        return self._log.next_number(MAP_STREAM) - self.next_number

    def take(self, limit: int) -> tuple[int, tuple[int, ...]]:
        """How many of the next events were taken, at most `limit` (fewer of large ones), and the versions that are in
        the store by them.

        Raises InputError if versions are there and no frame is pinned, LogDamaged, and ServiceError from the store;
        after any of these the store is as it was, and this projector of no more use.
        """
        with _uncollected():
            batch = self._next_batch(limit)
            changes: list[MapChange] = []
            checkpoint = self._checkpoint
            for version in batch.versions:
                change = self._change_of(version)
                if change is not None:
                    changes.append(change)
                    checkpoint = checkpoint.after(version.position)
            if changes:
                self._store.apply_all(changes, checkpoint)
                self._checkpoint = checkpoint
        self.next_number = max(self.next_number, batch.next_number)
        return batch.count, tuple(change.version.map_version for change in changes)

    def close(self) -> None:
        """Nothing is read any more."""
        self._reader.shutdown(cancel_futures=True)

    def _next_batch(self, limit: int) -> "_Batch":
        """The next events; while the database takes them in, those after them are read."""
        batch = self._read(limit) if self._ahead is None else self._ahead.result()
        self._ahead = self._reader.submit(self._read, limit) if self._follower.is_behind else None
        return batch

    def _read(self, limit: int) -> "_Batch":
        """The next events; an error is kept, so that none of the versions before it is lost by it."""
        if self._error is not None:
            error, self._error = self._error, None
            raise error
        runs = self._follower.take(limit, limit_bytes=BATCH_BYTES)
        versions: list[SolvedVersion] = []
        try:
            for run in runs:
                versions.extend(self._open.after(run))
        except EventRejected as error:
            self._error = error
        count = sum(len(run.run) for run in runs)
        return _Batch(count, runs[-1].next_number if runs else 0, tuple(versions))

    def _change_of(self, version: SolvedVersion) -> MapChange | None:
        """What the version changes, which is known from now on; None for one that is refused."""
        reason = refusal_of(version, newest=self._newest, valid=self._valid)
        if reason:
            self._refused(version.solved.map_version, reason)
            return None
        frame = self._frame = self._frame or logged_frame(self._log)
        labels = self._labels_of(version.solved.inputs) if version.anchors else {}
        try:
            change = map_change(version, frame=frame, labels=labels, valid=self._valid)
        except FrameRefused as error:
            self._refused(version.solved.map_version, str(error))
            return None
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


@contextmanager
def _uncollected() -> Iterator[None]:
    """No garbage collection inside: events hold no cycles, and looking for some takes a sixth of the time."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
