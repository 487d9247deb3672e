"""What a landmark store can do, whatever keeps it."""

from collections.abc import Iterator, Sequence
from typing import Protocol

from trigpoint.landmarks.model import Checkpoint, Landmark, LandmarkChanges, MapChange, MapRow, MapVersion
from trigpoint.landmarks.queries import LandmarkQuery


class LandmarkStore(Protocol):
    """A projection of the log: every map version, and how far the log has been taken in."""

    def apply(self, change: MapChange, checkpoint: Checkpoint) -> None:
        """One map version and the checkpoint that goes with it, both or neither.

        Raises InputError for a version not after the last one, for a frame other than that of the versions
        before, for an id closed that is not valid and for one opened that still is; ServiceError if the
        database cannot be written.
        """

    def apply_all(self, changes: Sequence[MapChange], checkpoint: Checkpoint) -> None:
        """Consecutive map versions, at least one, and the checkpoint after the last: all or nothing.

        The rows are the same as if each were applied by itself. Raises as `apply`.
        """

    def defer_indexes(self) -> None:
        """From now on many versions are applied and few questions asked: indexes may be put off, answers slow."""

    def restore_indexes(self) -> None:
        """Every index is there."""

    def landmarks(self, query: LandmarkQuery) -> tuple[Landmark, ...]:
        """The landmarks that meet a query, all of one version; none while no version is there.

        Raises InputError for an unknown version.
        """

    def history(self, landmark: str) -> tuple[Landmark, ...]:
        """Every row a landmark has had, in order of version; none for an id the map never had."""

    def changes(self, query: LandmarkQuery, *, since: int) -> LandmarkChanges:
        """What changed between version `since` and the query's, among the landmarks that meet the query.

        `removed` are ids that met it at `since` and no longer do. Raises InputError for an unknown version, for a
        `since` after the query's version, and for a limit, a page or a number of the nearest, which would make
        removals of landmarks that are only cut off.
        """

    def map_versions(self) -> tuple[MapVersion, ...]:
        """All map versions in order."""

    def newest_version(self) -> MapVersion | None:
        """The newest map version, None while there is none."""

    def checkpoint(self) -> Checkpoint:
        """How far the log has been taken in."""

    def rows(self) -> Iterator[MapRow]:
        """Every row of every version, in no particular order: what two stores are compared by."""

    def damage(self) -> tuple[str, ...]:
        """What is wrong with the store's own files and indexes, as far as it can tell; nothing for a sound one."""

    def close(self) -> None:
        """Nothing more is held open."""
