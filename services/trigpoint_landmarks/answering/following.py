"""The newest version in memory kept in step: by the change feed, and by the store wherever the feed has a gap."""

import logging
import threading
from collections.abc import Iterable
from contextlib import AbstractContextManager

from trigpoint.bus.ports import BusMessage
from trigpoint.errors import InputError
from trigpoint.landmarks.asked import AnsweredMap, answered_map
from trigpoint.landmarks.model import Landmark, MapVersion
from trigpoint.landmarks.notices import (
    TILE_SCHEMA,
    VERSION_SCHEMA,
    StepAssembly,
    decoded_version_change,
    tile_of_key,
)
from trigpoint.landmarks.ports import LandmarkStore
from trigpoint.landmarks.queries import LandmarkQuery
from trigpoint_landmarks.answering.newest_version import NewestVersion

logger = logging.getLogger(__name__)


class FollowedVersion:
    """The newest version, for one thread that follows and others that read it inside `reading`."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._newest = NewestVersion()
        self._assembly = StepAssembly()

    @property
    def map_version(self) -> int:
        """The number of the version held, 0 before the first."""
        return self._newest.map_version

    def reading(self) -> "AbstractContextManager[NewestVersion]":
        """The version, as it is, while it is open."""
        return _Reading(self)

    def look(self, store: LandmarkStore) -> None:
        """The version held is the store's newest. Raises as the store does."""
        newest = store.newest_version()
        held = self.map_version
        if newest is None or newest.map_version == held:
            return
        if held == 0 or newest.map_version < held or not self._has_caught_up(store, newest):
            self._read_anew(store, newest)

    def hear(self, message: BusMessage, store: LandmarkStore) -> None:
        """A message of the feed taken in. Raises InputError for one that is none, and as the store does."""
        if message.schema_name == TILE_SCHEMA:
            self._assembly.keep(tile_of_key(message.key), message.payload)
        elif message.schema_name == VERSION_SCHEMA:
            told = decoded_version_change(message.payload)
            held = self.map_version
            step = self._assembly.step(told) if told.before == held > 0 else None
            if step is not None:
                self._change(step.map, changed=step.changed, removed=step.removed)
            elif told.map.map_version > held:
                self.look(store)

    def _has_caught_up(self, store: LandmarkStore, newest: MapVersion) -> bool:
        """Whether the store still knows the version held; then what changed since is taken in."""
        try:
            found = store.changes(LandmarkQuery(as_of=newest.map_version), since=self.map_version)
        except InputError as error:
            logger.warning("the map is read anew: %s", error)
            return False
        self._change(answered_map(newest), changed=found.changed, removed=found.removed)
        return True

    def _read_anew(self, store: LandmarkStore, newest: MapVersion) -> None:
        fresh = NewestVersion()
        rows = store.landmarks(LandmarkQuery(as_of=newest.map_version))
        fresh.change(answered_map(newest), changed=rows, removed=())
        with self._lock:
            self._newest = fresh

    def _change(self, to: AnsweredMap, *, changed: Iterable[Landmark], removed: Iterable[str]) -> None:
        with self._lock:
            self._newest.change(to, changed=changed, removed=removed)

    def _acquire(self) -> NewestVersion:
        self._lock.acquire()
        return self._newest

    def _release(self) -> None:
        self._lock.release()


class _Reading(AbstractContextManager[NewestVersion]):
    """A class of its own: a generator costs each answer microseconds."""

    __slots__ = ("_followed",)

    def __init__(self, followed: FollowedVersion) -> None:
        self._followed = followed

    def __enter__(self) -> NewestVersion:
        return self._followed._acquire()

    def __exit__(self, *_: object) -> None:
        self._followed._release()
