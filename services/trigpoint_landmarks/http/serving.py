"""The HTTP service at work: an event loop of its own, until it is told to stop."""

import asyncio
import logging
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import uvicorn
import uvloop

from trigpoint.bus.ports import Bus, News
from trigpoint.errors import ServiceError
from trigpoint.events.keys import DEFAULT_ROOT, KEY_PATTERNS, KEY_VERSION
from trigpoint.events.mapped import MapSolved
from trigpoint.landmarks.feature_query import FeatureSource
from trigpoint.observability.metrics import Instruments
from trigpoint_landmarks.http.application import Served, application
from trigpoint_landmarks.http.map_watch import MapWatch
from trigpoint_landmarks.http.ports import MapCorrections, MeasuredDrives
from trigpoint_landmarks.http.settings import WebSettings

LISTEN_S = 0.5  # between two looks whether to go on listening to the bus
GRACE_S = 5  # for requests that are under way when the service is told to stop
KEEP_ALIVE_S = 30
WAITING = 1024  # connections not yet accepted

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class ServedLog:
    """What a log takes and what it holds, and the folder of check layers beside it; None: there is none."""

    corrections: MapCorrections | None = None
    drives: MeasuredDrives | None = None
    shifts: Path | None = None


NO_LOG = ServedLog()


class HttpService:
    """The map over HTTP. `open_source` is called in the event loop's thread; a message of a new version only wakes up.

    Raises InputError for a token file that cannot be read, ServiceError where the address cannot be had.
    """

    def __init__(
        self,
        settings: WebSettings,
        open_source: Callable[[], FeatureSource],
        *,
        log: ServedLog = NO_LOG,
        bus: Bus | None = None,
        root: str = DEFAULT_ROOT,
        instruments: Instruments | None = None,
    ) -> None:
        self._settings, self._open_source, self._log = settings, open_source, log
        self._instruments = instruments or Instruments("http")
        self._socket = _listening(settings)
        self._news: News | None = None
        if bus is not None:
            pattern = KEY_PATTERNS[MapSolved].format(map="*")
            self._news = bus.news(f"{root}/{KEY_VERSION}/{pattern}")
        self._watch: MapWatch | None = None

    @property
    def ready(self) -> bool:
        """Whether it answers, and the database was there at the last look."""
        return self._watch is not None and self._watch.reached

    @property
    def port(self) -> int:
        """Where it answers."""
        port: int = self._socket.getsockname()[1]
        return port

    def run(self, stop: threading.Event) -> None:
        """Works until told to stop; requests under way are finished first. Raises InputError, ServiceError."""
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            runner.run(self._serve(stop))

    def close(self) -> None:
        """Nothing is listened to any more; again: no effect."""
        self._socket.close()
        if self._news is not None:
            self._news.close()

    async def _serve(self, stop: threading.Event) -> None:
        source = self._open_source()
        watch = MapWatch(source, look_s=self._settings.look_s)
        log = self._log
        served = Served(source=source, watch=watch, corrections=log.corrections, drives=log.drives, shifts=log.shifts)
        server = uvicorn.Server(self._configuration(application(self._settings, served, self._instruments)))
        following = asyncio.create_task(watch.follow())
        listening = asyncio.create_task(self._listen(watch, stop))
        serving = asyncio.create_task(server.serve([self._socket]))
        self._watch = watch
        logger.info("serving", extra={"host": self._settings.host, "port": self.port})
        try:
            await asyncio.wait((serving, listening), return_when=asyncio.FIRST_COMPLETED)
            server.should_exit = True
            watch.close()  # who listens is let go, so that the server need not wait for them
            await serving
        finally:
            self._watch = None
            following.cancel()
            await asyncio.gather(following, listening, return_exceptions=True)
            await source.close()

    async def _listen(self, watch: MapWatch, stop: threading.Event) -> None:
        """Tells the watch of new versions, until the service is to stop."""
        while not await asyncio.to_thread(self._heard, stop, watch, asyncio.get_running_loop()):
            pass

    def _heard(self, stop: threading.Event, watch: MapWatch, loop: asyncio.AbstractEventLoop) -> bool:
        """Whether to stop, after a while."""
        if self._news is None:
            return stop.wait(LISTEN_S)
        if self._news.wait(LISTEN_S):
            loop.call_soon_threadsafe(watch.tell)
        return stop.is_set()

    def _configuration(self, served: object) -> uvicorn.Config:
        return uvicorn.Config(
            served,  # type: ignore[arg-type]  # an ASGI application, which has no type of its own here
            http="httptools",
            ws="none",
            lifespan="off",
            interface="asgi3",
            log_config=None,
            access_log=False,
            server_header=False,
            date_header=True,
            proxy_headers=False,
            timeout_keep_alive=KEEP_ALIVE_S,
            timeout_graceful_shutdown=GRACE_S,
        )


def _listening(settings: WebSettings) -> socket.socket:
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((settings.host, settings.port))
        listening.listen(WAITING)
    except OSError as error:
        listening.close()
        raise ServiceError(f"nothing can be served on {settings.host}:{settings.port}: {error.strerror}") from error
    listening.setblocking(False)
    return listening
