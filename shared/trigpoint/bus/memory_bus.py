"""A bus in memory: sessions of one exchange hear one another, in the same process."""

import threading
from collections.abc import Sequence
from types import TracebackType
from typing import Self

from trigpoint.bus.arrivals import messages_of_run, run_of_messages
from trigpoint.bus.bell import Bell
from trigpoint.bus.inbox import INBOX_CAPACITY, Inbox
from trigpoint.bus.key_expressions import checked_expression, checked_key, key_matches
from trigpoint.bus.memory_queries import MemoryQueryable, MemoryQueryables
from trigpoint.bus.ports import BusMessage, BusRun, Content, Replies
from trigpoint.errors import ServiceError


class MemorySubscription:
    """Messages of one expression; made by MemoryBus.subscribe."""

    def __init__(self, expression: str, exchange: "MemoryExchange", capacity: int) -> None:
        self._expression = expression
        self._exchange = exchange
        self._inbox: Inbox[BusMessage] = Inbox(capacity)

    @property
    def lost(self) -> int:
        """How many messages were dropped because the queue was full."""
        return self._inbox.lost

    @property
    def waiting(self) -> int:
        """How many messages wait to be received."""
        return self._inbox.held

    @property
    def waiting_bytes(self) -> int:
        """How large they are."""
        return self._inbox.held_bytes

    def matches(self, key: str) -> bool:
        """Whether messages on this key belong here."""
        return key_matches(self._expression, key)

    def offer(self, message: BusMessage) -> None:
        """The message queued, or counted as lost."""
        self._inbox.offer(message, size_bytes=len(message.payload))

    def receive(self, timeout_s: float) -> BusMessage | None:
        """The next message, or None if none came within `timeout_s` or the subscription is closed."""
        return self._inbox.take(timeout_s)

    def receive_run(self, timeout_s: float) -> BusRun | None:
        """The next message as a run of one: in memory each comes by itself."""
        message = self._inbox.take(timeout_s)
        return None if message is None else run_of_messages([message])

    def close(self) -> None:
        """No more messages; ones not yet received are dropped."""
        self._exchange.leave(self)
        self._inbox.close()


class MemoryNews:
    """Word of messages of one expression; made by MemoryBus.news."""

    def __init__(self, expression: str, exchange: "MemoryExchange") -> None:
        self._expression, self._exchange = expression, exchange
        self._bell = Bell()

    def matches(self, key: str) -> bool:
        """Whether messages on this key are news here."""
        return key_matches(self._expression, key)

    def offer(self, message: BusMessage) -> None:
        """Word of the message, which is not kept."""
        self._bell.ring()

    def wait(self, timeout_s: float) -> bool:
        """Whether something came since the last time, or comes within `timeout_s`."""
        return self._bell.wait(timeout_s)

    def close(self) -> None:
        """No more news."""
        self._exchange.leave(self)
        self._bell.silence()


Listener = MemorySubscription | MemoryNews


class MemoryClaim:
    """A claimed key; made by MemoryBus.claim."""

    def __init__(self, key: str, exchange: "MemoryExchange") -> None:
        self.key = key
        self._exchange = exchange

    def release(self) -> None:
        """The key no longer claimed."""
        self._exchange.release(self)


class MemoryExchange:
    """What the sessions of one bus share: who listens to what, and who claims what."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._joined = threading.Condition(self._lock)
        self._subscriptions: tuple[Listener, ...] = ()
        self._claims: tuple[MemoryClaim, ...] = ()
        self.queryables = MemoryQueryables()

    def hold(self, claim: MemoryClaim) -> None:
        """From now on the claim is seen."""
        with self._lock:
            self._claims = (*self._claims, claim)

    def release(self, claim: MemoryClaim) -> None:
        """The claim is seen no more; again: no effect."""
        with self._lock:
            self._claims = tuple(other for other in self._claims if other is not claim)

    def claimed(self, expression: str) -> tuple[str, ...]:
        """The claimed keys an expression matches, sorted."""
        return tuple(sorted({claim.key for claim in self._claims if key_matches(expression, claim.key)}))

    def join(self, subscription: Listener) -> None:
        """From now on the subscription hears what matches it."""
        with self._lock:
            self._subscriptions = (*self._subscriptions, subscription)
            self._joined.notify_all()

    def leave(self, subscription: Listener) -> None:
        """The subscription hears no more; again: no effect."""
        with self._lock:
            self._subscriptions = tuple(other for other in self._subscriptions if other is not subscription)

    def listeners(self, key: str) -> list[Listener]:
        """The subscriptions that match a key, in order of joining."""
        return [subscription for subscription in self._subscriptions if subscription.matches(key)]

    def await_listener(self, key: str, timeout_s: float) -> bool:
        """Whether a subscription that matches the key is there, or joins within `timeout_s`."""
        with self._joined:
            return self._joined.wait_for(lambda: bool(self.listeners(key)), timeout_s)


class MemoryBus:
    """A session on an exchange; without one given, on an exchange of its own."""

    def __init__(self, exchange: MemoryExchange | None = None, *, capacity: int = INBOX_CAPACITY) -> None:
        self._exchange = exchange if exchange is not None else MemoryExchange()
        self._capacity = capacity
        self._own: list[Listener] = []
        self._queryables: list[MemoryQueryable] = []
        self._claims: list[MemoryClaim] = []
        self._closed = False

    def publish(self, message: BusMessage) -> None:
        """The message queued with every matching subscription."""
        self._require_open()
        for subscription in self._exchange.listeners(checked_key(message.key)):
            subscription.offer(message)

    def publish_all(self, messages: Sequence[BusMessage]) -> None:
        """Each message queued with every subscription that matches it."""
        for message in messages:
            self.publish(message)

    def publish_run(self, run: BusRun) -> None:
        """Each message of the run queued with every subscription that matches its key."""
        self.publish_all(list(messages_of_run(run)))

    def claim(self, key: str) -> MemoryClaim:
        """The key claimed on the exchange."""
        self._require_open()
        claim = MemoryClaim(checked_key(key), self._exchange)
        self._claims.append(claim)
        self._exchange.hold(claim)
        return claim

    def claimed(self, key_expression: str) -> tuple[str, ...]:
        """The exchange's claimed keys that match."""
        self._require_open()
        return self._exchange.claimed(checked_expression(key_expression))

    def subscribe(self, key_expression: str) -> MemorySubscription:
        """A subscription to all keys the expression matches."""
        self._require_open()
        subscription = MemorySubscription(checked_expression(key_expression), self._exchange, self._capacity)
        self._own.append(subscription)
        self._exchange.join(subscription)
        return subscription

    def news(self, key_expression: str) -> MemoryNews:
        """Word of every message on the keys the expression matches."""
        self._require_open()
        news = MemoryNews(checked_expression(key_expression), self._exchange)
        self._own.append(news)
        self._exchange.join(news)
        return news

    def queryable(self, key_expression: str) -> MemoryQueryable:
        """Queries on all keys the expression matches."""
        self._require_open()
        queryables = self._exchange.queryables
        queryable = MemoryQueryable(checked_expression(key_expression), queryables, self._capacity)
        self._queryables.append(queryable)
        queryables.join(queryable)
        return queryable

    def get(self, key_expression: str, content: Content, *, timeout_s: float) -> Replies:
        """What the exchange's queryables reply."""
        self._require_open()
        return self._exchange.queryables.ask(checked_expression(key_expression), content, timeout_s)

    def await_queryable(self, key: str, timeout_s: float) -> bool:
        """Whether a queryable of the exchange matches the key, at once or within `timeout_s`."""
        self._require_open()
        return self._exchange.queryables.await_one(checked_key(key), timeout_s)

    def has_listener(self, key: str) -> bool:
        """Whether a subscription of the exchange matches the key."""
        self._require_open()
        return bool(self._exchange.listeners(checked_key(key)))

    def await_listener(self, key: str, timeout_s: float) -> bool:
        """Whether a subscription of the exchange matches the key, at once or within `timeout_s`."""
        self._require_open()
        return self._exchange.await_listener(checked_key(key), timeout_s)

    def close(self) -> None:
        """The session, its subscriptions and claims ended."""
        self._closed = True
        for subscription in self._own:
            subscription.close()
        self._own.clear()
        for queryable in self._queryables:
            queryable.close()
        self._queryables.clear()
        for claim in self._claims:
            claim.release()
        self._claims.clear()

    def _require_open(self) -> None:
        if self._closed:
            raise ServiceError("the bus is closed: nothing can be published or subscribed on it any more")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
