"""Takes the log's map versions into the landmark database, and holds the two against one another."""

import tempfile
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint.landmarks.ports import LandmarkStore
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import Progress, in_silence
from trigpoint_landmarks.core.comparison import RowDifference, checkpoint_differences, differences
from trigpoint_landmarks.projecting import Projector
from trigpoint_landmarks.settings import DATABASE_NAME, LandmarkSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class ProjectionReport:
    """What one projection did: versions taken in, versions refused with the reason, and how the map stands."""

    applied: tuple[int, ...]
    refused: tuple[tuple[int, str], ...]
    map_version: int | None
    landmark_count: int


def project(log: EventLog, store: LandmarkStore, *, progress: Progress = in_silence) -> ProjectionReport:
    """Every map version after the store's checkpoint taken in.

    `progress` gets events read and events there are. A version whose events are not whole is refused and counted;
    the next one goes on. Raises InputError if versions are there and no frame is pinned; ServiceError from the store.
    """
    settings = LandmarkSettings()
    applied: list[int] = []
    refused: list[tuple[int, str]] = []
    with closing(Projector(log, store, refused=lambda version, reason: refused.append((version, reason)))) as projector:
        total = projector.lag_events
        if total > settings.bulk_events:
            store.defer_indexes()
        taken, versions = projector.take(settings.batch_events)
        while taken:
            applied += versions
            progress(total - projector.lag_events, total)
            taken, versions = projector.take(settings.batch_events)
        store.restore_indexes()
        return ProjectionReport(
            applied=tuple(applied),
            refused=tuple(refused),
            map_version=projector.map_version or None,
            landmark_count=projector.landmark_count,
        )


def replay_difference(
    log: EventLog, held: LandmarkStore, *, progress: Progress = in_silence
) -> tuple[RowDifference, ...]:
    """Where a database differs from one rebuilt from the whole log; nothing if it is equal.

    Damage to a file or its indexes counts as a difference. The database is only read.
    """
    with (
        tempfile.TemporaryDirectory(prefix="trigpoint-replay-") as folder,
        closing(GeoPackageStore(Path(folder) / DATABASE_NAME)) as replayed,
    ):
        project(log, replayed, progress=progress)
        return (
            *(RowDifference("file", "", line) for line in held.damage()),
            *checkpoint_differences(held.checkpoint(), replayed.checkpoint()),
            *differences(held.rows(), replayed.rows()),
        )
