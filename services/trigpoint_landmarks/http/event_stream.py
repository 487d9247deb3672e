"""New map versions as server-sent events (WHATWG HTML, 9.2): told at once, and a sign of life between them."""

import json
import time
from collections.abc import AsyncIterator, Callable
from http import HTTPStatus

from starlette.responses import Response, StreamingResponse

from trigpoint.observability.metrics import Instruments
from trigpoint_landmarks.http.admission import Message, Receive
from trigpoint_landmarks.http.map_watch import MapWatch
from trigpoint_landmarks.http.problems import Problem

PATH = "/events"
KIND = "text/event-stream"
ALIVE_S = 5.0  # between two signs of life at the most
LIFE_S = 600.0  # then the stream ends, and who listens asks anew: a token may have been revoked
HEADERS = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}


class VersionFeed:
    """Tells whoever listens of the versions a watch knows; at most `limit` of them at once."""

    def __init__(
        self, watch: MapWatch, instruments: Instruments, *, limit: int, now_ns: Callable[[], int] = time.time_ns
    ) -> None:
        self._watch, self._limit, self._now_ns = watch, limit, now_ns
        self._counted = instruments.listeners
        self.listeners = 0

    async def serve(self, scope: Message, receive: Receive, send: Callable[..., object]) -> None:
        """One listener, until it goes, its time is over, or the service stops. Raises Problem for one too many."""
        if scope["method"] == "HEAD":
            await Response(None, HTTPStatus.OK, HEADERS, KIND)(scope, receive, send)  # type: ignore[arg-type]
            return
        if self.listeners >= self._limit:
            detail = f"{self.listeners} listen already, and no more may"
            raise Problem(HTTPStatus.SERVICE_UNAVAILABLE, detail, {"Retry-After": "5"})
        self.listeners += 1
        self._counted.inc()
        try:
            streamed = StreamingResponse(self._told(), HTTPStatus.OK, HEADERS, KIND)
            await streamed(scope, receive, send)  # type: ignore[arg-type]
        finally:
            self.listeners -= 1
            self._counted.dec()

    async def _told(self) -> AsyncIterator[bytes]:
        """What one listener is told."""
        ends_s = time.monotonic() + LIFE_S
        told: int | None = -1
        while not self._watch.closed and time.monotonic() < ends_s:
            changed = self._watch.changed
            state = self._watch.state
            newest = None if state is None else state.newest
            yield self._event("version" if newest != told else "alive", newest)
            told = newest
            await self._watch.changes(changed, within_s=ALIVE_S)

    def _event(self, name: str, newest: int | None) -> bytes:
        state = self._watch.state
        data = {
            "map_version": newest,
            "solved_ns": None if state is None else state.solved_ns,
            "now_ns": self._now_ns(),
            "database_reached": self._watch.reached,
        }
        number = f"id: {newest}\n" if name == "version" and newest is not None else ""
        return f"event: {name}\n{number}data: {json.dumps(data)}\n\n".encode()
