"""Who is let in: a token's scope, how often one may ask, how much one may send."""

import asyncio
import time
from collections.abc import Callable, MutableMapping
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any

from trigpoint.errors import InputError
from trigpoint_landmarks.http.problems import Problem
from trigpoint_landmarks.http.settings import WebSettings, is_loopback
from trigpoint_landmarks.http.tokens import Scope, TokenFile

Message = MutableMapping[str, Any]
Receive = Callable[[], Any]

BEARER = b"bearer "
CHALLENGE = {"WWW-Authenticate": 'Bearer realm="trigpoint"'}
HEADER_LIMIT = 512  # bytes of an Authorization header
KNOWN_LIMIT = 10_000  # of those whose requests are counted
ANYONE = "anyone"


@dataclass(frozen=True, slots=True)
class Caller:
    """Who asks: a token's name or an address, and what is allowed; `scope` None: nothing."""

    name: str
    scope: Scope | None

    def require(self, wanted: Scope) -> None:
        """Raises Problem for a caller that may not."""
        if self.scope is None:
            raise Problem(HTTPStatus.UNAUTHORIZED, "a token is needed: Authorization: Bearer …", CHALLENGE)
        if not self.scope.allows(wanted):
            detail = f"scope {wanted.value!r} is needed; this caller has {self.scope.value!r}"
            raise Problem(HTTPStatus.FORBIDDEN, detail)


class Buckets:
    """How often each caller may ask: a bucket each that holds `burst` and fills at `rate_hz`."""

    def __init__(self, *, rate_hz: float, burst: int) -> None:
        self._rate_hz, self._burst = rate_hz, float(burst)
        self._left: dict[str, tuple[float, float]] = {}

    def wait_s(self, name: str, *, now_s: float) -> float:
        """0 for a request that may pass now and counts from now on, else the seconds until one may."""
        left, then_s = self._left.get(name, (self._burst, now_s))
        left = min(self._burst, left + (now_s - then_s) * self._rate_hz)
        if left < 1.0:
            return (1.0 - left) / self._rate_hz
        if len(self._left) >= KNOWN_LIMIT and name not in self._left:
            self._left.pop(next(iter(self._left)))
        self._left[name] = (left - 1.0, now_s)
        return 0.0


class Admission:
    """Decides on each request. Raises InputError for a token file that cannot be read."""

    def __init__(self, settings: WebSettings, *, now_s: Callable[[], float] = time.monotonic) -> None:
        self._settings, self._now_s = settings, now_s
        self._tokens = None if settings.token_file is None else TokenFile(settings.token_file)
        self._buckets = Buckets(rate_hz=settings.rate_hz, burst=settings.burst)
        self._guests = self._guest_scope()

    @property
    def is_open(self) -> bool:
        """Whether anybody may read: then what is read may be kept by caches for many."""
        return self._settings.open_reading

    def caller(self, scope: Message) -> Caller:
        """Who asks. Raises Problem for a token that is none, and for one who asks too often."""
        address = scope["client"][0] if scope.get("client") else "unknown"
        given = next((value for name, value in scope["headers"] if name == b"authorization"), None)
        try:
            caller = Caller(address, self._guests) if given is None else self._of_token(given)
        except Problem:
            self._count(address)
            raise
        self._count(caller.name if given is None else f"token {caller.name}")
        return caller

    def _guest_scope(self) -> Scope | None:
        """What is allowed without a token."""
        if self._settings.open_reading:
            return Scope.READ
        return Scope.READ if self._tokens is None and is_loopback(self._settings.host) else None

    def _of_token(self, header: bytes) -> Caller:
        if self._tokens is None or len(header) > HEADER_LIMIT or header[: len(BEARER)].lower() != BEARER:
            raise Problem(HTTPStatus.UNAUTHORIZED, "this token is not valid here", CHALLENGE)
        secret = header[len(BEARER) :].strip().decode("latin-1")
        try:
            token = self._tokens.token_of(secret, now_s=self._now_s())
        except InputError as error:
            raise Problem(HTTPStatus.SERVICE_UNAVAILABLE, "tokens cannot be checked now") from error
        if token is None:
            raise Problem(HTTPStatus.UNAUTHORIZED, "this token is not valid here", CHALLENGE)
        return Caller(token.name, token.scope)

    def _count(self, name: str) -> None:
        wait_s = self._buckets.wait_s(name, now_s=self._now_s())
        if wait_s > 0.0:
            headers = {"Retry-After": str(max(1, round(wait_s + 0.5)))}
            raise Problem(
                HTTPStatus.TOO_MANY_REQUESTS, f"at most {self._settings.rate_hz:g} requests a second", headers
            )


async def whole_body(receive: Receive, *, limit: int, timeout_s: float) -> bytes:
    """The body of a request. Raises Problem for one that is too large, too slow, or given up."""
    parts: list[bytes] = []
    size = 0
    try:
        async with asyncio.timeout(timeout_s):
            more = True
            while more:
                message = await receive()
                if message["type"] == "http.disconnect":
                    raise Problem(HTTPStatus.BAD_REQUEST, "the body ended early")
                parts.append(message.get("body", b""))
                size += len(parts[-1])
                require_size(size, limit)
                more = message.get("more_body", False)
    except TimeoutError as error:
        raise Problem(HTTPStatus.REQUEST_TIMEOUT, f"the body was not here within {timeout_s:g} s") from error
    return b"".join(parts)


def require_size(size: int, limit: int) -> None:
    """Raises Problem for a body that is too large."""
    if size > limit:
        detail = f"a body of more than {limit} bytes is not taken"
        raise Problem(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, detail, {"Connection": "close"})


def announced_size(scope: Message) -> int:
    """How large the body is by its header; 0 where none says so. Raises Problem for a header that is no number."""
    stated = next((value for name, value in scope["headers"] if name == b"content-length"), b"0")
    if not stated.isdigit() or len(stated) > 18:
        raise Problem(HTTPStatus.BAD_REQUEST, "Content-Length is no number")
    return int(stated)
