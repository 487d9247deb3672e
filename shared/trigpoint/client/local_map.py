"""The landmarks of an area kept at hand, in step with the map."""

import logging
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from types import TracebackType
from typing import Self

from trigpoint.bus.ports import BusMessage, Subscription
from trigpoint.client.asking import MapClient, relocalised_among
from trigpoint.client.core.constellations import Constellation
from trigpoint.client.core.known_landmarks import EXPECTED, GnssPrior, area_around
from trigpoint.client.core.motion_fit import Expectation
from trigpoint.client.core.relocalisation import Relocalised
from trigpoint.errors import InputError, MapUnanswered, ServiceError
from trigpoint.events.keys import LANDMARK_ZOOM, TILE_CHANGE_PATTERN, VERSION_CHANGE_PATTERN, map_key
from trigpoint.geodesy.positions import Wgs84Position
from trigpoint.geodesy.web_tiles import WebTile, tile_at, tile_edges_deg
from trigpoint.landmarks.asked import AnsweredMap, VersionChange
from trigpoint.landmarks.model import Landmark
from trigpoint.landmarks.notices import (
    TILE_SCHEMA,
    VERSION_SCHEMA,
    StepAssembly,
    decoded_version_change,
    tile_of,
    tile_of_key,
)
from trigpoint.landmarks.queries import LAT_LIMIT_DEG, LON_LIMIT_DEG, DegreeBox, LandmarkQuery
from trigpoint.landmarks.selection import answered

SUBSCRIPTIONS_MOST = 64  # tiles subscribed one by one; of a wider area all tiles are heard, and the others passed over
TILES_MOST = 100_000
LOOK_S = 2.0  # between two looks whether word was lost, while nothing is heard
ROUNDING_DEG = 1e-9
PATIENCE_S = 0.2  # for a message under way, between two looks at the queue

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Staleness:
    """How old what is held may be: its version, the newest one heard of, and for how many seconds nothing has
    confirmed that the one is the other (infinity: nothing ever did)."""

    held_version: int
    newest_version: int
    unconfirmed_s: float


@dataclass(frozen=True, slots=True)
class _Held:
    """One version, whole: a reader takes hold of it and is not disturbed by the next."""

    map: AnsweredMap = field(default_factory=AnsweredMap)
    landmarks: dict[str, Landmark] = field(default_factory=dict)


class LocalMap:
    """The landmarks of the tiles that meet a box, followed in a thread of its own; a context manager.

    Every version's differences are taken in whole, so that a reader sees one version. What was lost is seen in the
    versions that follow, or found by a look every `look_s`, and healed by asking for the changes since the version
    held. While nobody answers it stays as it is, and says how stale; so it does for good once its bus is closed.
    Raises InputError for an area of too many tiles.
    """

    def __init__(
        self,
        client: MapClient,
        area: DegreeBox,
        *,
        look_s: float = LOOK_S,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._client, self._look_s, self._now_s = client, look_s, now_s
        self._tiles = tiles_of(area)
        self._box = box_of(self._tiles)
        self._changed = threading.Condition()
        self._held, self._assembly = _Held(), StepAssembly()
        self._newest, self._confirmed_s, self._heals = 0, float("-inf"), 0
        self._stop = threading.Event()
        self._tile_subscriptions: dict[WebTile, Subscription] = {}
        self._subscriptions = self._subscribed()
        self._thread = threading.Thread(target=self._run, name="local-map", daemon=True)
        self._thread.start()

    def landmarks(self, query: LandmarkQuery) -> tuple[Landmark, ...]:
        """The landmarks of the area that meet a query, of the version held. Raises InputError for another version."""
        held = self._held
        if query.as_of not in (None, held.map.map_version):
            raise InputError(f"map version {query.as_of} is asked for: {held.map.map_version} is held")
        return answered(tuple(held.landmarks.values()), query)

    @property
    def map_version(self) -> int:
        """The version held, 0 before the first."""
        return self._held.map.map_version

    @property
    def heals(self) -> int:
        """How often what was lost had to be asked for, the first reading included."""
        return self._heals

    def staleness(self) -> Staleness:
        """How old what is held may be."""
        return Staleness(
            held_version=self.map_version,
            newest_version=max(self._newest, self.map_version),
            unconfirmed_s=self._now_s() - self._confirmed_s,
        )

    def await_version(self, map_version: int, timeout_s: float) -> bool:
        """Whether this version or a later one is held, at once or within the time."""
        with self._changed:
            return self._changed.wait_for(lambda: self.map_version >= map_version, timeout_s)

    def relocalise(
        self, observations: Constellation, gnss_prior: GnssPrior, *, expected: Expectation = EXPECTED
    ) -> Relocalised | None:
        """As MapClient's, among the landmarks held: nothing is asked. Raises FrameRefused before the first version."""
        around = self.landmarks(LandmarkQuery(near=area_around(gnss_prior, observations)))
        frame = self._held.map.frame()
        return relocalised_among(list(around), observations, gnss_prior, frame=frame, expected=expected)

    def close(self) -> None:
        """Nothing is followed any more; what is held stays. Again: no effect."""
        self._stop.set()
        for subscription in self._subscriptions:
            subscription.close()
        self._thread.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _subscribed(self) -> list[Subscription]:
        """To versions first, and then to tiles: each by itself, or all of them together."""
        subscribe = self._client.bus.subscribe
        versions = subscribe(self._key(VERSION_CHANGE_PATTERN))
        if len(self._tiles) > SUBSCRIPTIONS_MOST:
            return [versions, subscribe(self._key(TILE_CHANGE_PATTERN, zoom=LANDMARK_ZOOM, column="*", row="*"))]
        for tile in self._tiles:
            key = self._key(TILE_CHANGE_PATTERN, zoom=tile.zoom, column=tile.column, row=tile.row)
            self._tile_subscriptions[tile] = subscribe(key)
        return [versions, *self._tile_subscriptions.values()]

    def _key(self, pattern: str, **chunks: str | int) -> str:
        return map_key(pattern, root=self._client.root, map_name=self._client.map_name, chunks=chunks)

    def _run(self) -> None:
        """Follows until it is closed; the service being away is no end of it."""
        looked_s = float("-inf")
        while not self._stop.is_set():
            try:
                if self._now_s() - looked_s >= self._look_s:
                    looked_s = self._now_s()
                    self._look()
                message = self._subscriptions[0].receive(min(self._look_s, PATIENCE_S))
                if message is not None:
                    self._hear(message)
                    looked_s = self._now_s()
            except (MapUnanswered, InputError) as error:
                logger.warning("the local map stays at version %d for now: %s", self.map_version, error)
                self._stop.wait(PATIENCE_S)
            except ServiceError as error:
                if not self._stop.is_set():
                    logger.error("the local map stays at version %d for good: %s", self.map_version, error)
                return

    def _look(self) -> None:
        """Whether the version held is the newest, as the service says; if not it is taken in."""
        newest = self._client.landmarks(LandmarkQuery(bbox=self._box, limit=1)).map.map_version
        self._newest = max(self._newest, newest)
        if newest > self.map_version:
            self._heal()
        elif newest == self.map_version:
            self._confirmed_s = self._now_s()

    def _hear(self, message: BusMessage) -> None:
        """A version taken in, or healed where something of it or before it is missing."""
        if message.schema_name != VERSION_SCHEMA:
            return
        told = decoded_version_change(message.payload)
        self._newest = max(self._newest, told.map.map_version)
        if told.map.map_version <= self.map_version:
            return
        if told.before != self.map_version or not self._stepped(told):
            self._heal()

    def _stepped(self, told: VersionChange) -> bool:
        """Whether everything of a version in the area came; then it is held.

        Each subscription has an order of its own: a tile's change may come a moment after its version's.
        """
        for subscription in self._subscriptions[1:]:
            while self._keep(subscription.receive(0.0)):
                pass
        until_s = self._now_s() + PATIENCE_S
        for tile in self._assembly.missing(told, self._tiles):
            subscription = self._tile_subscriptions.get(tile, self._subscriptions[-1])
            while tile in self._assembly.missing(told, self._tiles):
                if not self._keep(subscription.receive(max(0.0, until_s - self._now_s()))):
                    return False
        step = self._assembly.step(told, self._tiles)
        if step is None:
            return False
        self._take(step.map, self._held.landmarks, changed=step.changed, removed=step.removed)
        return True

    def _keep(self, message: BusMessage | None) -> bool:
        """Whether there was a message; a tile's change is kept until its version is told of."""
        if message is None:
            return False
        if message.schema_name == TILE_SCHEMA and tile_of_key(message.key) in self._tiles:
            self._assembly.keep(tile_of_key(message.key), message.payload)
        return True

    def _heal(self) -> None:
        """What changed since the version held asked for; all of the area where none is held, or it is too much."""
        if self.map_version == 0:
            self._read()
            return
        try:
            answer = self._client.changes(self.map_version, LandmarkQuery(bbox=self._box))
        except InputError as error:
            logger.warning("the local map is read anew: %s", error)
            self._read()
            return
        self._heals += 1
        self._take(answer.map, self._held.landmarks, changed=answer.changed, removed=answer.removed)

    def _read(self) -> None:
        rows: list[Landmark] = []
        for page in self._client.pages(LandmarkQuery(bbox=self._box)):
            rows += page.landmarks
        if page.map.map_version > self.map_version:
            self._heals += 1
            self._take(page.map, {}, changed=rows, removed=())

    def _take(
        self, to: AnsweredMap, held: Mapping[str, Landmark], *, changed: Iterable[Landmark], removed: Iterable[str]
    ) -> None:
        """From now on this version is held: what was, and what changed; a landmark that left the area is not."""
        landmarks = dict(held)
        for name in removed:
            landmarks.pop(name, None)
        for row in changed:
            landmarks.pop(row.landmark, None)
            if tile_of(row) in self._tiles:
                landmarks[row.landmark] = row
        self._newest = max(self._newest, to.map_version)
        with self._changed:
            self._held, self._confirmed_s = _Held(to, landmarks), self._now_s()
            self._changed.notify_all()


def tiles_of(area: DegreeBox) -> frozenset[WebTile]:
    """The tiles of the change feed that meet a box. Raises InputError for too many."""
    first = tile_at(Wgs84Position(area.lat_max_deg, area.lon_min_deg), LANDMARK_ZOOM)
    last = tile_at(Wgs84Position(area.lat_min_deg, area.lon_max_deg), LANDMARK_ZOOM)
    count = (last.column - first.column + 1) * (last.row - first.row + 1)
    if count > TILES_MOST:
        raise InputError(f"an area of {count} tiles: at most {TILES_MOST} are followed")
    columns, rows = range(first.column, last.column + 1), range(first.row, last.row + 1)
    return frozenset(WebTile(LANDMARK_ZOOM, column, row) for column in columns for row in rows)


def box_of(tiles: Iterable[WebTile]) -> DegreeBox:
    """The box that holds tiles, at least one, and what rounding may put beside them."""
    edges = [tile_edges_deg(tile) for tile in tiles]
    return DegreeBox(
        lon_min_deg=max(min(edge[0] for edge in edges) - ROUNDING_DEG, -LON_LIMIT_DEG),
        lat_min_deg=max(min(edge[1] for edge in edges) - ROUNDING_DEG, -LAT_LIMIT_DEG),
        lon_max_deg=min(max(edge[2] for edge in edges) + ROUNDING_DEG, LON_LIMIT_DEG),
        lat_max_deg=min(max(edge[3] for edge in edges) + ROUNDING_DEG, LAT_LIMIT_DEG),
    )
