"""Takes the log's map versions into the landmark database, and holds the two against one another."""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from trigpoint.events.corrected import AnchorLabelled, Corrected
from trigpoint.events.envelope import Envelope, LogPosition
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.mapped import Mapped, MapSolved
from trigpoint.geodesy.projection import MapFrame
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint.landmarks.ports import LandmarkStore
from trigpoint.landmarks.queries import LandmarkQuery
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import Progress, in_silence, logged_frame
from trigpoint_landmarks.core.comparison import RowDifference, checkpoint_differences, differences
from trigpoint_landmarks.core.rows import labels_within, map_change, valid_after
from trigpoint_landmarks.core.versions import Logged, refusal_of, solved_versions
from trigpoint_landmarks.settings import DATABASE_NAME

MAP_STREAM = STREAM_PATTERNS[MapSolved]
LABEL_STREAM = STREAM_PATTERNS[AnchorLabelled]


@dataclass(frozen=True, slots=True, kw_only=True)
class ProjectionReport:
    """What one projection did: versions taken in, versions refused with the reason, and how the map stands."""

    applied: tuple[int, ...]
    refused: tuple[tuple[int, str], ...]
    map_version: int | None
    landmark_count: int


def project(log: EventLog, store: LandmarkStore, *, progress: Progress = in_silence) -> ProjectionReport:
    """Every map version after the store's checkpoint taken in, each in one transaction.

    `progress` gets events read and events there are. A version whose events are not whole is refused and counted;
    the next one goes on. Raises InputError if versions are there and no frame is pinned; ServiceError from the store.
    """
    corrected = tuple(_corrections(log))
    valid = {landmark.landmark: landmark for landmark in store.landmarks(LandmarkQuery())}
    newest = max((version.map_version for version in store.map_versions()), default=0)
    applied: list[int] = []
    refused: list[tuple[int, str]] = []
    frame: MapFrame | None = None
    for version in solved_versions(_mapped(log, store.checkpoint().next_number(MAP_STREAM), progress)):
        reason = refusal_of(version, newest=newest)
        if reason:
            refused.append((version.solved.map_version, reason))
            continue
        frame = frame or logged_frame(log)
        labels = labels_within(corrected, version.solved.inputs)
        change = map_change(version, frame=frame, labels=labels, valid=valid)
        store.apply(change, store.checkpoint().after(version.position))
        valid, newest = valid_after(valid, change), version.solved.map_version
        applied.append(newest)
    return ProjectionReport(
        applied=tuple(applied), refused=tuple(refused), map_version=newest or None, landmark_count=len(valid)
    )


def replay_difference(log: EventLog, store_path: Path, *, progress: Progress = in_silence) -> tuple[RowDifference, ...]:
    """Where the database at `store_path` differs from one rebuilt from the whole log; nothing if it is equal.

    Damage to the file or its indexes counts as a difference. The database is only read. Raises InputError if it is
    missing or no landmark database.
    """
    held = GeoPackageStore(store_path, read_only=True)
    try:
        with tempfile.TemporaryDirectory(prefix="trigpoint-replay-") as folder:
            replayed = GeoPackageStore(Path(folder) / DATABASE_NAME)
            try:
                project(log, replayed, progress=progress)
                return (
                    *(RowDifference("file", store_path.name, line) for line in held.damage()),
                    *checkpoint_differences(held.checkpoint(), replayed.checkpoint()),
                    *differences(held.rows(), replayed.rows()),
                )
            finally:
                replayed.close()
    finally:
        held.close()


def _mapped(log: EventLog, first_number: int, progress: Progress) -> Iterator[Logged]:
    total = log.next_number(MAP_STREAM) - first_number
    for done, logged in enumerate(log.read(MAP_STREAM, first_number=first_number), start=1):
        if isinstance(logged.envelope.event, Mapped):
            yield logged.position, cast(Envelope[Mapped], logged.envelope)
        progress(done, total)


def _corrections(log: EventLog) -> Iterator[tuple[LogPosition, Corrected]]:
    for logged in log.read(LABEL_STREAM):
        if isinstance(logged.envelope.event, Corrected):
            yield logged.position, logged.envelope.event
