"""What a bus can do, whatever carries it."""

from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

from trigpoint.events.envelope import EventIdentity
from trigpoint.events.runs import EncodedRun

PROTOBUF = "application/protobuf"
UNIDENTIFIED = EventIdentity("", "", -1)
"""Identity of a message that came without a readable attachment: its sender does not speak trigpoint."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BusMessage:
    """One message: `key` as in dataflow, payload in the Protobuf schema `schema_name` of the writer's
    `schema_version`, identity and time of measurement.
    """

    key: str
    schema_name: str
    payload: bytes
    identity: EventIdentity
    stamp_ns: int
    schema_version: int = 1


@dataclass(frozen=True, slots=True)
class BusRun:
    """Messages of one key, schema, source and boot that came or go together."""

    key: str
    schema_version: int
    run: EncodedRun


@dataclass(frozen=True, slots=True)
class Content:
    """What a query or a reply says: bytes of a media type, and the Protobuf schema they are in, if they are."""

    payload: bytes
    schema_name: str = ""
    media_type: str = PROTOBUF


@dataclass(frozen=True, slots=True)
class Reply:
    """One reply to a query, on a key; a refusal says why there is no other."""

    key: str
    content: Content
    refused: bool = False


@dataclass(frozen=True, slots=True)
class Replies:
    """What was replied to a query in order of arrival; `whole`: everyone who was asked has finished in time."""

    items: tuple[Reply, ...]
    whole: bool


class Query(Protocol):
    """A question that waits for replies until it is closed; a context manager, so that it is."""

    @property
    def key(self) -> str:
        """The key replies go on: that of the query, or that of the queryable if the query names none."""

    @property
    def content(self) -> Content:
        """What is asked."""

    def reply(self, content: Content) -> None:
        """One more reply. Raises ServiceError where the query or its session is closed."""

    def refuse(self, content: Content) -> None:
        """Why there is no reply. Raises as `reply` does."""

    def close(self) -> None:
        """No more replies; again: no effect."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


class Queryable(Protocol):
    """Queries that arrived for one key expression, in order of arrival."""

    @property
    def lost(self) -> int:
        """How many queries arrived and were closed unanswered because the queue was full; never reset."""

    @property
    def waiting(self) -> int:
        """How many queries wait to be received."""

    def receive(self, timeout_s: float) -> Query | None:
        """The next query, or None if none came within `timeout_s` or the queryable is closed."""

    def close(self) -> None:
        """No more queries; ones not yet received are closed unanswered."""


class Claim(Protocol):
    """A key held under one's name for as long as the session lives, for all to see; nothing forbids a second one."""

    def release(self) -> None:
        """The key no longer claimed; again: no effect."""


class Subscription(Protocol):
    """Messages that arrived for one key expression, in order of arrival."""

    @property
    def lost(self) -> int:
        """How many messages arrived and were dropped because the queue was full; never reset."""

    @property
    def waiting(self) -> int:
        """How many messages wait to be received."""

    @property
    def waiting_bytes(self) -> int:
        """How many bytes those take that wait, as far as they were not looked at yet."""

    def receive(self, timeout_s: float) -> BusMessage | None:
        """The next message, or None if none came within `timeout_s` or the subscription is closed."""

    def receive_run(self, timeout_s: float) -> BusRun | None:
        """The messages of the key that waits longest, many at once, or None as `receive`; a message is received once,
        by either. Only messages of one key keep their order."""

    def close(self) -> None:
        """No more messages; ones not yet received are dropped."""


class News(Protocol):
    """That something was published under a key expression, and nothing of what: however much it was, it takes no room.
    For those who read the log and only want to be woken."""

    def wait(self, timeout_s: float) -> bool:
        """Whether something came since the last time this was true, or comes within `timeout_s`; once closed, False at
        once."""

    def close(self) -> None:
        """No more news, a `wait` under way is ended; again: no effect."""


class Bus(Protocol):
    """Publishes and subscribes; a context manager, so that it is always closed."""

    def publish(self, message: BusMessage) -> None:
        """The message handed to the transport; no promise that anyone got it.

        Raises InputError for a key that may not be published, ServiceError on a closed bus.
        """

    def publish_all(self, messages: Sequence[BusMessage]) -> None:
        """Each message as by `publish`, in as few transmissions as will do; only messages of one key keep their order.

        For senders whose messages are worth more together than at once. Raises as `publish` does.
        """

    def publish_run(self, run: BusRun) -> None:
        """A run's messages as by `publish_all`. Raises as `publish` does."""

    def subscribe(self, key_expression: str) -> Subscription:
        """A subscription to all keys the expression matches (`*` one chunk, `**` any number).

        Raises InputError for an expression that is not well formed, ServiceError on a closed bus.
        """

    def news(self, key_expression: str) -> News:
        """Word of every message on the keys the expression matches. Raises as `subscribe` does."""

    def queryable(self, key_expression: str) -> Queryable:
        """Queries on all keys the expression matches, to be answered. Raises as `subscribe` does."""

    def get(self, key_expression: str, content: Content, *, timeout_s: float) -> Replies:
        """What every queryable that matches replies, as soon as all have finished or `timeout_s` is over.

        Nobody there to answer: no reply at once. Raises as `subscribe` does.
        """

    def await_queryable(self, key: str, timeout_s: float) -> bool:
        """Whether a queryable that matches the key is known here now or within `timeout_s`."""

    def has_listener(self, key: str) -> bool:
        """Whether a subscription that matches the key is known here now: what is published before is lost."""

    def await_listener(self, key: str, timeout_s: float) -> bool:
        """The same as soon as it is so, or False after `timeout_s`."""

    def claim(self, key: str) -> Claim:
        """The key claimed until released or the session ends, however it ends.

        Raises InputError for a key that may not be published, ServiceError on a closed bus.
        """

    def claimed(self, key_expression: str) -> tuple[str, ...]:
        """The claimed keys an expression matches, one's own included, sorted, as far as word of them has come here:
        others' claims take a moment. Raises as `subscribe` does.
        """

    def close(self) -> None:
        """The session, its subscriptions and claims ended; again: no effect."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
