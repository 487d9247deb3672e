"""The change feed: once a map version is durable, what became different in each tile is told under the tile's key."""

import logging
import queue
import threading
import uuid
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Self

from trigpoint.bus.ports import Bus, BusMessage
from trigpoint.errors import ServiceError
from trigpoint.events.envelope import EventIdentity
from trigpoint.events.keys import TILE_CHANGE_PATTERN, VERSION_CHANGE_PATTERN, map_key
from trigpoint.geodesy.web_tiles import WebTile
from trigpoint.landmarks.asked import AnsweredMap, TileChange, VersionChange, answered_map
from trigpoint.landmarks.model import Checkpoint, Landmark, LandmarkChanges, MapChange, MapRow, MapVersion
from trigpoint.landmarks.net_changes import net_change
from trigpoint.landmarks.notices import (
    TILE_SCHEMA,
    VERSION_SCHEMA,
    tile_change_bytes,
    tile_changes,
    tile_of,
    version_change_bytes,
)
from trigpoint.landmarks.ports import LandmarkStore
from trigpoint.landmarks.queries import LandmarkQuery

SOURCE = "trigpoint_landmarks"
TOLD_MOST = 20_000  # landmarks told of singly in one step; of more only the version is told
STEPS_WAITING = 64  # to be told; older ones are dropped, which whoever follows sees as a gap, and asks

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class DurableStep:
    """From version `before` to that of `map`; `tiles` None: too much is different to be told singly."""

    map: AnsweredMap
    before: int
    tiles: tuple[TileChange, ...] | None


class ChangeFeed:
    """Tells of steps in a thread of its own, so that no listener holds up the projection; a context manager."""

    def __init__(self, bus: Bus, *, root: str, map_name: str) -> None:
        self._bus, self._root, self._map_name = bus, root, map_name
        self._boot_id, self._sequence = uuid.uuid4().hex, 0
        self._steps: queue.Queue[DurableStep | None] = queue.Queue(STEPS_WAITING)
        self._thread = threading.Thread(target=self._run, name="change-feed", daemon=True)
        self._thread.start()

    def tell(self, step: DurableStep) -> None:
        """The step told of soon; where too many wait, the oldest never is."""
        while True:
            try:
                self._steps.put_nowait(step)
                return
            except queue.Full:
                self._drop_oldest()

    def close(self) -> None:
        """What was waiting is told; again: no effect."""
        if self._thread.is_alive():
            self._steps.put(None)
            self._thread.join()

    def _drop_oldest(self) -> None:
        try:
            dropped = self._steps.get_nowait()
        except queue.Empty:
            return
        if dropped is not None:
            logger.warning("a version's changes are not told", extra={"map_version": dropped.map.map_version})

    def _run(self) -> None:
        while (step := self._steps.get()) is not None:
            try:
                self._bus.publish_all(list(self._messages(step)))
            except ServiceError as error:
                logger.warning("changes were not told: %s", error, extra={"map_version": step.map.map_version})

    def _messages(self, step: DurableStep) -> Iterator[BusMessage]:
        """The tiles' messages, and last the version's."""
        root, map_name = self._root, self._map_name
        stamp_ns = step.map.solved_ns
        for change in step.tiles or ():
            tile = change.tile
            chunks = {"zoom": tile.zoom, "column": tile.column, "row": tile.row}
            key = map_key(TILE_CHANGE_PATTERN, root=root, map_name=map_name, chunks=chunks)
            yield self._message(key, TILE_SCHEMA, tile_change_bytes(change), stamp_ns)
        tiles = None if step.tiles is None else frozenset(change.tile for change in step.tiles)
        told = VersionChange(map=step.map, before=step.before, tiles=tiles)
        yield self._message(
            map_key(VERSION_CHANGE_PATTERN, root=root, map_name=map_name),
            VERSION_SCHEMA,
            version_change_bytes(told),
            stamp_ns,
        )

    def _message(self, key: str, schema_name: str, payload: bytes, stamp_ns: int) -> BusMessage:
        identity = EventIdentity(SOURCE, self._boot_id, self._sequence)
        self._sequence += 1
        return BusMessage(key=key, schema_name=schema_name, payload=payload, identity=identity, stamp_ns=stamp_ns)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class FeedingStore:
    """A LandmarkStore that hands every step to a feed once it is durable, and else is the store it is made of."""

    def __init__(self, store: LandmarkStore, feed: ChangeFeed) -> None:
        self._store, self._feed = store, feed
        self._held: tuple[int, dict[str, WebTile]] | None = None

    def apply(self, change: MapChange, checkpoint: Checkpoint) -> None:
        """One map version, told once it is durable."""
        self.apply_all((change,), checkpoint)

    def apply_all(self, changes: Sequence[MapChange], checkpoint: Checkpoint) -> None:
        """Consecutive map versions, told as one step once they are durable."""
        before, tiles = self._held = self._held or self._known()
        self._store.apply_all(changes, checkpoint)
        self._held = (changes[-1].version.map_version, tiles)
        self._feed.tell(durable_step(changes, before=before, tiles=tiles))

    def _known(self) -> tuple[int, dict[str, WebTile]]:
        """The newest version, and the tile of each of its landmarks."""
        newest = self._store.newest_version()
        rows = self._store.landmarks(LandmarkQuery())
        return (newest.map_version if newest else 0), {row.landmark: tile_of(row) for row in rows}

    def defer_indexes(self) -> None:
        """As the store's own."""
        self._store.defer_indexes()

    def restore_indexes(self) -> None:
        """As the store's own."""
        self._store.restore_indexes()

    def landmarks(self, query: LandmarkQuery) -> tuple[Landmark, ...]:
        """As the store's own."""
        return self._store.landmarks(query)

    def history(self, landmark: str) -> tuple[Landmark, ...]:
        """As the store's own."""
        return self._store.history(landmark)

    def changes(self, query: LandmarkQuery, *, since: int) -> LandmarkChanges:
        """As the store's own."""
        return self._store.changes(query, since=since)

    def map_versions(self) -> tuple[MapVersion, ...]:
        """As the store's own."""
        return self._store.map_versions()

    def newest_version(self) -> MapVersion | None:
        """As the store's own."""
        return self._store.newest_version()

    def checkpoint(self) -> Checkpoint:
        """As the store's own."""
        return self._store.checkpoint()

    def rows(self) -> Iterator[MapRow]:
        """As the store's own."""
        return self._store.rows()

    def damage(self) -> tuple[str, ...]:
        """As the store's own."""
        return self._store.damage()

    def close(self) -> None:
        """The store closed."""
        self._store.close()


def durable_step(changes: Sequence[MapChange], *, before: int, tiles: dict[str, WebTile]) -> DurableStep:
    """What consecutive versions come to in each tile; `tiles`, each valid landmark's, is as it is after them."""
    net = net_change(changes)
    opened = [(tile_of(row), row) for row in net.opened]
    closed = [(tiles.pop(name), name) for name in net.closed]
    tiles.update((row.landmark, tile) for tile, row in opened)
    after = answered_map(changes[-1].version)
    told = None
    if len(opened) + len(closed) <= TOLD_MOST:
        told = tile_changes(before=before, after=after.map_version, opened=opened, closed=closed)
    return DurableStep(map=after, before=before, tiles=told)
