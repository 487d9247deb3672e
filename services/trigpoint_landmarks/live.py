"""The projection as a service: the landmark database follows the log, whatever becomes of either process."""

import logging
import threading
import time
from collections.abc import Callable
from contextlib import closing

from trigpoint.bus.ports import Bus, News
from trigpoint.errors import DatabaseUnavailable
from trigpoint.events.keys import DEFAULT_ROOT, KEY_PATTERNS, KEY_VERSION
from trigpoint.events.mapped import MapSolved
from trigpoint.landmarks.ports import LandmarkStore
from trigpoint.logs.ports import EventLog
from trigpoint.observability.backlog import Backlog
from trigpoint.observability.metrics import Instruments
from trigpoint_landmarks.projecting import MAP_STREAM, Projector
from trigpoint_landmarks.settings import LandmarkSettings

logger = logging.getLogger(__name__)


class LandmarkProjection:
    """Catches up with the log, then follows it; a message of a new version only wakes it up.

    `open_store` opens the database anew to write; it is called again, with growing pauses, whenever the database is
    away. Rows and checkpoint are committed together, so that nothing is taken in twice and nothing left out.
    """

    def __init__(
        self,
        log: EventLog,
        open_store: Callable[[], LandmarkStore],
        *,
        bus: Bus | None = None,
        root: str = DEFAULT_ROOT,
        settings: LandmarkSettings | None = None,
        instruments: Instruments | None = None,
    ) -> None:
        self._log, self._open_store = log, open_store
        self._settings = settings or LandmarkSettings()
        self._instruments = instruments or Instruments("landmarks")
        self._news: News | None = None
        if bus is not None:
            pattern = KEY_PATTERNS[MapSolved].format(map="*")
            self._news = bus.news(f"{root}/{KEY_VERSION}/{pattern}")
        self._ready = False
        self._next_number = 0
        self._backlog = Backlog(self._instruments)

    @property
    def ready(self) -> bool:
        """Whether the database has everything the log has."""
        return self._ready

    def run(self, stop: threading.Event) -> None:
        """Works until told to stop; a transaction that was begun is finished first.

        Raises InputError where versions are there and no frame is pinned or the database's schema is newer, LogDamaged
        where the log is, and ServiceError for an error of the database that waiting does not mend.
        """
        pause_s = self._settings.retry_s
        while not stop.is_set():
            try:
                with closing(self._open_store()) as store:
                    pause_s = self._settings.retry_s
                    self._follow(store, stop)
            except DatabaseUnavailable as error:
                self._ready = False
                self._show_lag()
                logger.warning("tried again in %g s: %s", pause_s, error)
                stop.wait(pause_s)
                pause_s = min(2.0 * pause_s, self._settings.retry_limit_s)

    def close(self) -> None:
        """Nothing more is heard; again: no effect."""
        self._ready = False
        if self._news is not None:
            self._news.close()

    def _follow(self, store: LandmarkStore, stop: threading.Event) -> None:
        with closing(Projector(self._log, store, refused=self._refuse)) as projector:
            self._catch_up(projector, store, stop)
            while not stop.is_set():
                if not self._take(projector):
                    self._ready = True
                    self._wait(stop)

    def _catch_up(self, projector: Projector, store: LandmarkStore, stop: threading.Event) -> None:
        lag_events = projector.lag_events
        if lag_events > self._settings.bulk_events:
            store.defer_indexes()
        logger.info("catching up", extra={"lag_events": lag_events, "map_version": projector.map_version})
        while not stop.is_set() and self._take(projector):
            pass
        if not stop.is_set():
            store.restore_indexes()

    def _take(self, projector: Projector) -> bool:
        """Whether there was something to take in; then it is in the database."""
        began_s = time.perf_counter()
        taken, versions = projector.take(self._settings.batch_events)
        if versions:
            self._instruments.projection_seconds.observe(time.perf_counter() - began_s)
        self._next_number = projector.next_number
        self._instruments.map_version.set(projector.map_version)
        self._show_lag()
        return taken > 0

    def _show_lag(self) -> None:
        lag_events = max(0, self._log.next_number(MAP_STREAM) - self._next_number)
        self._backlog.show(taken=self._next_number, lag_events=lag_events)

    def _refuse(self, map_version: int, reason: str) -> None:
        self._instruments.rejected.labels(vehicle="", reason="map version").inc()
        logger.error("map version refused", extra={"map_version": map_version, "reason": reason})

    def _wait(self, stop: threading.Event) -> None:
        """Until a version is told of or it is time to look at the log."""
        if self._news is None:
            stop.wait(self._settings.look_s)
        else:
            self._news.wait(self._settings.look_s)
