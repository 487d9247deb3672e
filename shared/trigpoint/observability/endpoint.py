"""Where a process says over HTTP that it lives, that it is ready, and its numbers."""

import json
import logging
import socket
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler
from socketserver import TCPServer, ThreadingMixIn
from types import TracebackType
from typing import Any, Protocol, Self

from trigpoint.errors import ServiceError

TEXT_FOR_PROMETHEUS = "text/plain; version=0.0.4; charset=utf-8"

Status = tuple[bool, Mapping[str, Any]]

logger = logging.getLogger(__name__)


class Health(Protocol):
    """What a process knows of itself; asked from several threads."""

    def alive(self) -> Status:
        """Whether it does its work or still can, and why."""

    def ready(self) -> Status:
        """Whether it has caught up, and what it waits for."""

    def exposition(self) -> bytes:
        """Its numbers as text for Prometheus."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EndpointSettings:
    """Address of the endpoint (port 0: any free one); beyond `parallel_limit` connections are closed unanswered,
    as is one that stays silent for `request_timeout_s`.
    """

    host: str
    port: int
    parallel_limit: int = 8
    request_timeout_s: float = 5.0


@dataclass(frozen=True, slots=True)
class _Page:
    status: int
    kind: str
    body: bytes


def _json_page(status: int, values: Mapping[str, Any]) -> _Page:
    return _Page(status, "application/json", json.dumps(values).encode() + b"\n")


def _status_page(status: Status) -> _Page:
    good, details = status
    return _json_page(200 if good else 503, {"ok": good, **details})


def page_at(path: str, health: Health) -> _Page:
    """What is answered at a path."""
    match path.partition("?")[0]:
        case "/healthz":
            return _status_page(health.alive())
        case "/readyz":
            return _status_page(health.ready())
        case "/metrics":
            return _Page(200, TEXT_FOR_PROMETHEUS, health.exposition())
        case _:
            return _json_page(404, {"error": "only /healthz, /readyz and /metrics are here"})


class _Handler(BaseHTTPRequestHandler):
    """One request a connection, GET or HEAD; anything else is refused by BaseHTTPRequestHandler."""

    server: "_Server"
    server_version, sys_version = "trigpoint", ""

    def setup(self) -> None:
        super().setup()
        self.connection.settimeout(self.server.settings.request_timeout_s)

    def do_GET(self) -> None:
        self._answer(with_body=True)

    def do_HEAD(self) -> None:
        self._answer(with_body=False)

    def _answer(self, *, with_body: bool) -> None:
        page = page_at(self.path, self.server.health)
        self.send_response(page.status)
        headers = {"Content-Type": page.kind, "Content-Length": str(len(page.body)), "Cache-Control": "no-store"}
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        if with_body:
            self.wfile.write(page.body)

    def log_message(self, format: str, *arguments: Any) -> None:
        """Nothing: a scrape every few seconds is no news."""


class _Server(ThreadingMixIn, TCPServer):
    """A thread a connection, of a bounded number."""

    allow_reuse_address = True
    daemon_threads = True
    block_on_close = False
    request_queue_size = 16

    def __init__(self, settings: EndpointSettings, health: Health) -> None:
        self.settings, self.health = settings, health
        self.address_family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
        self._room = threading.BoundedSemaphore(settings.parallel_limit)
        super().__init__((settings.host, settings.port), _Handler)

    def process_request(self, request: Any, client_address: Any) -> None:
        if self._room.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._room.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        logger.debug("a request from %s ended early", client_address, exc_info=True)


class Endpoint:
    """Answers until it is closed, in threads of its own. Raises ServiceError where the address cannot be had."""

    def __init__(self, settings: EndpointSettings, health: Health) -> None:
        try:
            self._server = _Server(settings, health)
        except OSError as error:
            raise ServiceError(f"nothing can be served on {settings.host}:{settings.port}: {error.strerror}") from error
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,), name="endpoint", daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """Where it answers."""
        host, port = self._server.server_address[:2]
        return f"http://[{host!s}]:{port}" if ":" in str(host) else f"http://{host!s}:{port}"

    def close(self) -> None:
        """No more requests; again: no effect."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
