"""Queries on Zenoh: queryables whose callback only queues, and what comes back to those who ask."""

import contextlib
from collections.abc import Iterator
from functools import lru_cache
from types import TracebackType
from typing import Self

import zenoh

from trigpoint.bus.inbox import INBOX_BYTES, Inbox
from trigpoint.bus.key_expressions import is_wild
from trigpoint.bus.ports import Content, Replies, Reply
from trigpoint.bus.zenoh_callback import JoinedCallback
from trigpoint.errors import ServiceError

QUERIES_WAITING = 4096  # at one queryable: an asker gives up long before the last of more is answered
TIMED_OUT, OF_ZENOH = b"Timeout", "zenoh/"  # what Zenoh itself puts in the place of replies that did not come


@lru_cache(maxsize=64)
def encoding_of(media_type: str, schema_name: str) -> zenoh.Encoding:
    """What Zenoh calls content of a media type and a schema."""
    encoding = zenoh.Encoding(media_type)
    return encoding.with_schema(schema_name) if schema_name else encoding


def content_of(payload: bytes, encoding: zenoh.Encoding | None) -> Content:
    """The content Zenoh brought."""
    media_type, _, schema_name = ("", "", "") if encoding is None else str(encoding).partition(";")
    return Content(payload, schema_name, media_type)


class ZenohQuery:
    """A question; made by ZenohQueryable."""

    def __init__(self, query: zenoh.Query, expression: str) -> None:
        self._query: zenoh.Query | None = query
        asked = str(query.key_expr)
        self._key = expression if is_wild(asked) else asked
        payload = query.payload
        self._content = content_of(b"" if payload is None else payload.to_bytes(), query.encoding)

    @property
    def key(self) -> str:
        """The key replies go on."""
        return self._key

    @property
    def content(self) -> Content:
        """What is asked."""
        return self._content

    def reply(self, content: Content) -> None:
        """One more reply."""
        encoding = encoding_of(content.media_type, content.schema_name)
        with self._saying():
            self._opened().reply(self._key, content.payload, encoding=encoding)

    def refuse(self, content: Content) -> None:
        """Why there is no reply."""
        encoding = encoding_of(content.media_type, content.schema_name)
        with self._saying():
            self._opened().reply_err(content.payload, encoding=encoding)

    def _opened(self) -> zenoh.Query:
        if self._query is None:
            raise ServiceError(f"the query on {self._key} is closed: nothing can be replied to it any more")
        return self._query

    @contextlib.contextmanager
    def _saying(self) -> Iterator[None]:
        try:
            yield
        except zenoh.ZError as error:
            raise ServiceError(f"nothing could be replied on {self._key}: {error}") from error

    def close(self) -> None:
        """No more replies."""
        query, self._query = self._query, None
        if query is not None:
            query.drop()  # type: ignore[no-untyped-call]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class ZenohQueryable:
    """Queries of one expression; made by ZenohBus.queryable. The transport's callback only queues them."""

    def __init__(self, session: zenoh.Session, key_expression: str) -> None:
        self._expression = key_expression
        self._inbox: Inbox[zenoh.Query] = Inbox(QUERIES_WAITING, capacity_bytes=INBOX_BYTES)
        self._callback: JoinedCallback[zenoh.Query] = JoinedCallback(self._inbox.offer)
        self._queryable = session.declare_queryable(key_expression, self._callback.handler)

    @property
    def lost(self) -> int:
        """How many queries were closed unanswered because the queue was full: nobody refers to them any more."""
        return self._inbox.lost

    @property
    def waiting(self) -> int:
        """How many queries wait to be received."""
        return self._inbox.held

    def receive(self, timeout_s: float) -> ZenohQuery | None:
        """The next query, or None if none came within `timeout_s` or the queryable is closed."""
        query = self._inbox.take(timeout_s)
        return None if query is None else ZenohQuery(query, self._expression)

    def close(self) -> None:
        """No more queries; ones not yet received are closed unanswered."""
        for query in self._inbox.close():
            query.drop()  # type: ignore[no-untyped-call]
        with contextlib.suppress(zenoh.ZError):  # already undeclared, or its session is gone
            self._queryable.undeclare()  # type: ignore[no-untyped-call]
        self._callback.join()


def replies_to(session: zenoh.Session, key_expression: str, content: Content, *, timeout_s: float) -> Replies:
    """What everyone who matches replies, several times on one key too."""
    handle = session.get(
        key_expression,
        payload=content.payload,
        encoding=encoding_of(content.media_type, content.schema_name),
        target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE,
        timeout=timeout_s,
    )
    items: list[Reply] = []
    whole = True
    for reply in handle:
        if reply.ok is not None:
            items.append(Reply(str(reply.ok.key_expr), content_of(reply.ok.payload.to_bytes(), reply.ok.encoding)))
        elif reply.err is not None:
            said = content_of(reply.err.payload.to_bytes(), reply.err.encoding)
            if said.payload == TIMED_OUT and said.media_type.startswith(OF_ZENOH):
                whole = False
            else:
                items.append(Reply(key_expression, said, refused=True))
    return Replies(tuple(items), whole)
