"""What every request passes first: admission, its body, the two busiest paths; and where every error ends."""

import logging
import time
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, Protocol

from starlette.requests import Request
from starlette.responses import Response

from trigpoint.landmarks.layers import Layer
from trigpoint_landmarks.http.admission import Admission, Message, Receive, announced_size, require_size, whole_body
from trigpoint_landmarks.http.asked import Asked, host_of
from trigpoint_landmarks.http.compression import negotiated
from trigpoint_landmarks.http.event_stream import PATH as EVENTS_PATH
from trigpoint_landmarks.http.event_stream import VersionFeed
from trigpoint_landmarks.http.measures import RequestMeasures
from trigpoint_landmarks.http.pages import Pages
from trigpoint_landmarks.http.problems import Problem, problem_of, problem_response
from trigpoint_landmarks.http.settings import WebSettings, is_loopback
from trigpoint_landmarks.http.tokens import Scope
from trigpoint_landmarks.http.viewer_api import ACCESS_PATH
from trigpoint_landmarks.http.viewer_files import PREFIX, viewer_files

READING = frozenset({"GET", "HEAD"})
EVERYWHERE = ((b"x-content-type-options", b"nosniff"), (b"referrer-policy", b"no-referrer"))

logger = logging.getLogger(__name__)


class Reading(Protocol):
    """The handlers of the busiest paths."""

    @property
    def pages(self) -> Pages:
        """Pages of features."""

    def asked(self, request: Request) -> Asked:
        """What a request asks."""

    def layer(self, name: str) -> Layer:
        """The layer of a name."""

    async def tile(
        self, request: Request, name: str, place: tuple[str, str, str], version: str | None = None
    ) -> Response:
        """A tile."""


@dataclass(frozen=True, slots=True)
class Beside:
    """What works beside the handlers: who follows the versions, and what is measured."""

    feed: VersionFeed
    measures: RequestMeasures


class Front:
    """An ASGI application in front of another one."""

    def __init__(
        self, behind: Any, api: Reading, admission: Admission, settings: WebSettings, *, beside: Beside
    ) -> None:
        self._behind, self._api, self._admission, self._settings = behind, api, admission, settings
        self._feed, self._measures = beside.feed, beside.measures
        self._local_only = settings.token_file is None and not settings.open_reading
        self._viewer = viewer_files()
        self._under_way = 0

    async def __call__(self, scope: Message, receive: Receive, send: Any) -> None:
        """One request."""
        if scope["type"] != "http":
            await self._behind(scope, receive, send)
            return
        started, status, began_s = False, 0, time.perf_counter()

        async def sent(message: Message) -> None:
            nonlocal started, status
            if message["type"] == "http.response.start":
                started, status = True, message["status"]
                message["headers"] = [*message.get("headers", ()), *EVERYWHERE]
            await send(message)

        self._under_way += 1
        try:
            if self._under_way > self._settings.parallel_limit:
                raise Problem(HTTPStatus.SERVICE_UNAVAILABLE, "too many requests are under way", {"Retry-After": "1"})
            await self._answer(scope, receive, sent)
        except Exception as error:
            if not started:  # else the framework has answered it already
                await problem_response(problem_of(error))(scope, receive, sent)
        finally:
            self._under_way -= 1
            if status:  # else whoever asked went before there was an answer
                self._measures.answered(scope["path"], status, seconds=time.perf_counter() - began_s)

    async def _answer(self, scope: Message, receive: Receive, send: Any) -> None:
        caller = self._admission.caller(scope)
        if self._local_only and not _called_locally(scope):
            raise Problem(HTTPStatus.MISDIRECTED_REQUEST, "only this machine's own names are served here")
        if scope["method"] in READING and _is_of_viewer(scope):  # its files hold nothing of the map
            await self._viewer.answer(scope["path"].removeprefix(PREFIX))(scope, receive, send)
            return
        if scope["path"] != ACCESS_PATH:  # who may do nothing may ask so
            caller.require(_needed(scope))
        scope.setdefault("state", {})["caller"] = caller
        if scope["path"] == EVENTS_PATH and scope["method"] in READING:
            await self._follow(scope, receive, send)
            return
        if scope["method"] in READING:
            response = await self._busiest(scope, receive)
            if response is not None:
                await response(scope, receive, send)
                return
        else:
            receive = await self._with_body(scope, receive)
        await self._behind(scope, receive, send)

    async def _follow(self, scope: Message, receive: Receive, send: Any) -> None:
        """One who listens for long: bounded by themselves, these are none of the requests under way."""
        self._under_way -= 1
        try:
            await self._feed.serve(scope, receive, send)
        finally:
            self._under_way += 1

    async def _busiest(self, scope: Message, receive: Receive) -> Response | None:
        """Items and tiles without the framework's way to them; None for any other path."""
        match scope["path"].split("/"):
            case ["", "collections", name, "items"]:
                request = Request(scope, receive)
                page = await self._api.pages.items(self._api.asked(request), self._api.layer(name))
                return await negotiated(page, request.headers.get("accept-encoding", ""))
            case ["", "tiles", name, zoom, column, row]:
                return await self._api.tile(Request(scope, receive), name, (zoom, column, row))
            case _:
                return None

    async def _with_body(self, scope: Message, receive: Receive) -> Receive:
        """The same body, here as a whole. Raises Problem for one that is too large or too slow."""
        limit = self._settings.body_limit_bytes
        require_size(announced_size(scope), limit)
        body = await whole_body(receive, limit=limit, timeout_s=self._settings.body_timeout_s)
        messages = [{"type": "http.request", "body": body, "more_body": False}]

        async def given() -> Message:
            return messages.pop() if messages else await receive()

        return given


def _needed(scope: Message) -> Scope:
    """What a caller has to be allowed."""
    if scope["method"] in READING or scope["method"] == "OPTIONS":
        return Scope.READ
    return Scope.ADMINISTER if scope["path"].startswith("/drives") else Scope.LABEL


def _is_of_viewer(scope: Message) -> bool:
    """Whether a path is one of the viewer's."""
    path: str = scope["path"]
    return path == PREFIX or path.startswith(f"{PREFIX}/")


def _called_locally(scope: Message) -> bool:
    """Whether the host that was called is this machine: another one's page may have its own name lead here."""
    host = host_of(scope)
    name = host[1 : host.index("]")] if host.startswith("[") else host.partition(":")[0]
    return is_loopback(name)
