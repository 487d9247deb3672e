"""The landmark store in memory: for tests, and for maps nobody keeps."""

from collections.abc import Iterator, Sequence

from trigpoint.errors import InputError
from trigpoint.landmarks.model import (
    Anchor,
    Checkpoint,
    ImageOffset,
    LabelGain,
    Landmark,
    LandmarkChanges,
    MapChange,
    MapRow,
    MapVersion,
    Trajectory,
    valid_at,
)
from trigpoint.landmarks.queries import LandmarkQuery, require_known_version, require_next_version
from trigpoint.landmarks.selection import answer_of, changes_of


class MemoryStore:
    """A LandmarkStore that is gone with its process."""

    def __init__(self) -> None:
        self._versions: tuple[MapVersion, ...] = ()
        self._valid: dict[str, Landmark] = {}
        self._ended: tuple[Landmark, ...] = ()
        self._others: tuple[Trajectory | Anchor | ImageOffset | LabelGain, ...] = ()
        self._checkpoint = Checkpoint()

    def apply(self, change: MapChange, checkpoint: Checkpoint) -> None:
        """One map version and its checkpoint; nothing if it is refused."""
        self.apply_all((change,), checkpoint)

    def apply_all(self, changes: Sequence[MapChange], checkpoint: Checkpoint) -> None:
        """Consecutive map versions and their checkpoint; nothing if one is refused."""
        before = (self._valid, self._ended, self._versions, self._others)
        try:
            for change in changes:
                self._take(change)
        except InputError:
            self._valid, self._ended, self._versions, self._others = before
            raise
        self._checkpoint = checkpoint

    def defer_indexes(self) -> None:
        """Nothing: there are none."""

    def restore_indexes(self) -> None:
        """Nothing: there are none."""

    def landmarks(self, query: LandmarkQuery) -> tuple[Landmark, ...]:
        """The landmarks that meet a query."""
        held: tuple[Landmark, ...] = tuple(self._valid.values())
        if query.as_of is not None:
            require_known_version(query.as_of, self.known_versions(query.as_of))
            held = tuple(landmark for landmark in held + self._ended if valid_at(landmark, query.as_of))
        return answer_of(lambda _: held, query)

    def history(self, landmark: str) -> tuple[Landmark, ...]:
        """Every row a landmark has had, in order of version."""
        found = [row for row in (*self._ended, *self._valid.values()) if row.landmark == landmark]
        return tuple(sorted(found, key=lambda row: row.valid_from_version))

    def changes(self, query: LandmarkQuery, *, since: int) -> LandmarkChanges:
        """What changed since a version among the landmarks that meet a query."""
        return changes_of(self, query, since=since)

    def known_versions(self, around: int) -> list[int]:
        """The numbers of all map versions."""
        return [version.map_version for version in self._versions]

    def ended(self, query: LandmarkQuery, *, since: int, as_of: int) -> list[Landmark]:
        """Rows valid at version `since`, and not any more at `as_of`."""
        return [row for row in self._ended if valid_at(row, since) and not valid_at(row, as_of)]

    def opened(self, query: LandmarkQuery, *, since: int, as_of: int) -> list[Landmark]:
        """Rows valid at version `as_of`, and not yet at `since`."""
        rows = (*self._ended, *self._valid.values())
        return [row for row in rows if valid_at(row, as_of) and not valid_at(row, since)]

    def newest_version(self) -> MapVersion | None:
        """The newest map version."""
        return self._versions[-1] if self._versions else None

    def map_versions(self) -> tuple[MapVersion, ...]:
        """All map versions in order."""
        return self._versions

    def checkpoint(self) -> Checkpoint:
        """How far the log has been taken in."""
        return self._checkpoint

    def rows(self) -> Iterator[MapRow]:
        """Every row of every version."""
        yield from self._versions
        yield from self._valid.values()
        yield from self._ended
        yield from self._others

    def damage(self) -> tuple[str, ...]:
        """Nothing: what is there is what was applied."""
        return ()

    def close(self) -> None:
        """Nothing is held open."""

    def _take(self, change: MapChange) -> None:
        require_next_version(change.version, self._versions)
        valid, ended = self._after(change)
        self._valid, self._ended = valid, self._ended + ended
        self._versions += (change.version,)
        self._others += change.trajectories + change.anchors + change.image_offsets + change.label_gains

    def _after(self, change: MapChange) -> tuple[dict[str, Landmark], tuple[Landmark, ...]]:
        map_version = change.version.map_version
        valid = dict(self._valid)
        found = [landmark for landmark in change.closed if landmark in valid]
        if len(found) != len(change.closed):
            raise InputError(f"map version {map_version} closes {len(change.closed)} landmarks: {len(found)} are valid")
        ended = tuple(valid.pop(landmark).until(map_version) for landmark in found)
        for landmark in change.opened:
            if landmark.landmark in valid:
                raise InputError(f"map version {map_version} opens {landmark.landmark!r}: it is still valid")
            valid[landmark.landmark] = landmark
        return valid, ended
