"""Queries in memory: an asker waits until everyone asked has closed the query."""

import threading
import time
from types import TracebackType
from typing import Self

from trigpoint.bus.inbox import Inbox
from trigpoint.bus.key_expressions import checked_key, expressions_meet, is_wild
from trigpoint.bus.ports import Content, Replies, Reply
from trigpoint.errors import ServiceError


class _Asked:
    """What an asker waits for: replies, and the number of queries that are still open."""

    def __init__(self, count: int) -> None:
        self._changed = threading.Condition()
        self._open = count
        self._replies: list[Reply] = []

    def add(self, reply: Reply) -> None:
        with self._changed:
            self._replies.append(reply)

    def finish(self) -> None:
        with self._changed:
            self._open -= 1
            self._changed.notify_all()

    def wait(self, timeout_s: float) -> Replies:
        with self._changed:
            whole = self._changed.wait_for(lambda: self._open <= 0, timeout_s)
            return Replies(tuple(self._replies), whole)


class MemoryQuery:
    """A question to one queryable; made by MemoryQueryables."""

    def __init__(self, key: str, content: Content, asked: _Asked) -> None:
        self._key, self._content, self._asked = key, content, asked
        self._closed = False

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
        self._say(Reply(checked_key(self._key), content))

    def refuse(self, content: Content) -> None:
        """Why there is no reply."""
        self._say(Reply(self._key, content, refused=True))

    def _say(self, reply: Reply) -> None:
        if self._closed:
            raise ServiceError(f"the query on {self._key} is closed: nothing can be replied to it any more")
        self._asked.add(reply)

    def close(self) -> None:
        """No more replies."""
        if not self._closed:
            self._closed = True
            self._asked.finish()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class MemoryQueryable:
    """Queries of one expression; made by MemoryBus.queryable."""

    def __init__(self, expression: str, queryables: "MemoryQueryables", capacity: int) -> None:
        self.expression = expression
        self._queryables = queryables
        self._inbox: Inbox[MemoryQuery] = Inbox(capacity)

    @property
    def lost(self) -> int:
        """How many queries were closed unanswered because the queue was full."""
        return self._inbox.lost

    @property
    def waiting(self) -> int:
        """How many queries wait to be received."""
        return self._inbox.held

    def offer(self, query: MemoryQuery) -> None:
        """The query queued, or closed and counted as lost."""
        lost = self._inbox.lost
        self._inbox.offer(query, size_bytes=len(query.content.payload))
        if self._inbox.lost > lost:
            query.close()

    def receive(self, timeout_s: float) -> MemoryQuery | None:
        """The next query, or None if none came within `timeout_s` or the queryable is closed."""
        return self._inbox.take(timeout_s)

    def close(self) -> None:
        """No more queries; ones not yet received are closed unanswered."""
        self._queryables.leave(self)
        for query in self._inbox.close():
            query.close()


class MemoryQueryables:
    """The queryables of an exchange, and the asking of them."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._all: tuple[MemoryQueryable, ...] = ()

    def join(self, queryable: MemoryQueryable) -> None:
        """From now on the queryable is asked."""
        with self._changed:
            self._all = (*self._all, queryable)
            self._changed.notify_all()

    def leave(self, queryable: MemoryQueryable) -> None:
        """The queryable is asked no more; again: no effect."""
        with self._changed:
            self._all = tuple(other for other in self._all if other is not queryable)

    def matching(self, expression: str) -> list[MemoryQueryable]:
        """The queryables that may have an answer."""
        return [one for one in self._all if expressions_meet(expression, one.expression)]

    def await_one(self, key: str, timeout_s: float) -> bool:
        """Whether a queryable that matches the key is there, or joins within `timeout_s`."""
        with self._changed:
            return self._changed.wait_for(lambda: bool(self.matching(key)), timeout_s)

    def ask(self, expression: str, content: Content, timeout_s: float) -> Replies:
        """What they reply until all have finished or the time is over."""
        began_s = time.monotonic()
        with self._changed:
            asked_of = self.matching(expression)
            asked = _Asked(len(asked_of))
            for one in asked_of:
                key = one.expression if is_wild(expression) else expression
                one.offer(MemoryQuery(key, content, asked))
        return asked.wait(timeout_s - (time.monotonic() - began_s))
