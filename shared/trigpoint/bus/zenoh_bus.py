"""The bus on Zenoh: the fast path between processes and machines; zenoh's one home."""

import contextlib
import json
import threading
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Literal, Self, cast

import zenoh

from trigpoint.bus.arrivals import Arrival, messages_of, messages_of_run, runs_of_key, runs_of_messages
from trigpoint.bus.attachment import encode_attachment, encode_bundle, run_attachments
from trigpoint.bus.bell import Bell
from trigpoint.bus.inbox import INBOX_BYTES, INBOX_CAPACITY, Inbox
from trigpoint.bus.key_expressions import checked_expression, checked_key
from trigpoint.bus.ports import PROTOBUF, BusMessage, BusRun, Content, Replies
from trigpoint.bus.tls import TlsFiles, checked_endpoints, tls_values
from trigpoint.bus.zenoh_callback import JoinedCallback
from trigpoint.bus.zenoh_queries import ZenohQueryable, encoding_of, replies_to
from trigpoint.errors import InputError, ServiceError

BUNDLE_COUNT = 256  # messages in a transmission: some 15 kB of IMU, below the 64 kB a Zenoh batch holds
BUNDLE_BYTES = 64 * 1024  # of payload in a transmission of more than one message
TOGETHER_COUNT, TOGETHER_BYTES = 2048, 1024 * 1024  # received at a time as runs
ARRIVAL_BYTES = 512  # a transmission in memory, besides its payload
CLAIM_LOOK_S = 5.0  # for the claims of everyone reachable; the answer comes in milliseconds


@dataclass(frozen=True, slots=True, kw_only=True)
class ZenohSettings:
    """A session's endpoints such as "tcp/127.0.0.1:7447"; scouting finds peers without endpoints, by multicast.

    A client waits `connect_timeout_s` for its first connection; a later one comes back by itself. With `tls` both ends
    of every link show certificates. Raises InputError where endpoints and `tls` do not go together, and for
    limits that let nothing through.
    """

    listen: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()
    mode: Literal["peer", "client", "router"] = "peer"
    connect_timeout_s: float = 0.0
    scouting: bool = False
    inbox_capacity: int = INBOX_CAPACITY
    inbox_bytes: int = INBOX_BYTES
    message_limit_bytes: int = 64 * 1024 * 1024
    tls: TlsFiles | None = None

    def __post_init__(self) -> None:
        checked_endpoints(self.listen, self.connect, self.tls)
        for name in ("inbox_capacity", "inbox_bytes", "message_limit_bytes"):
            if getattr(self, name) < 1:
                raise InputError(f"{name} {getattr(self, name)}: at least 1 is needed")


def session_config(settings: ZenohSettings) -> zenoh.Config:
    """What Zenoh is told. Raises InputError for files that are not there, or a key that others may read."""
    config = zenoh.Config()
    for name, value in (
        ("mode", settings.mode),
        ("listen/endpoints", list(settings.listen)),
        ("connect/endpoints", list(settings.connect)),
        ("connect/timeout_ms", {"client": round(1e3 * settings.connect_timeout_s)}),
        ("scouting/multicast/enabled", settings.scouting),
        ("scouting/gossip/enabled", settings.scouting),
        ("transport/link/rx/max_message_size", settings.message_limit_bytes),
        *(() if settings.tls is None else tls_values(settings.tls.checked())),
    ):
        config.insert_json5(name, json.dumps(value))
    return config


def _attachment(message: BusMessage) -> bytes:
    return encode_attachment(message.identity, stamp_ns=message.stamp_ns, schema_version=message.schema_version)


class ZenohSubscription:
    """Messages of one expression; made by ZenohBus.subscribe. The transport's callback only queues them."""

    def __init__(self, session: zenoh.Session, key_expression: str, inbox: Inbox[Arrival]) -> None:
        self._inbox = inbox
        self._unpacked: deque[BusMessage] = deque()
        self._runs: deque[BusRun] = deque()
        self._by_key: dict[tuple[str, str], list[Arrival]] = {}
        self._gathered = 0  # messages in them
        self._callback: JoinedCallback[zenoh.Sample] = JoinedCallback(self._arrived)
        self._subscriber = session.declare_subscriber(key_expression, self._callback.handler)

    def _arrived(self, sample: zenoh.Sample) -> None:
        attached = sample.attachment
        attachment = attached.to_bytes() if attached is not None else b""
        schema_name = str(sample.encoding).partition(";")[2]
        arrival = Arrival(str(sample.key_expr), schema_name, sample.payload.to_bytes(), attachment)
        self._inbox.offer(arrival, count=arrival.count, size_bytes=len(arrival.payload) + ARRIVAL_BYTES)

    @property
    def lost(self) -> int:
        """How many messages were dropped because the queue was full."""
        return self._inbox.lost

    @property
    def waiting(self) -> int:
        """How many messages wait to be received."""
        return self._inbox.held + self._gathered + len(self._unpacked) + sum(len(run.run) for run in self._runs)

    @property
    def waiting_bytes(self) -> int:
        """How large those are that were not looked at yet."""
        return self._inbox.held_bytes

    def receive(self, timeout_s: float) -> BusMessage | None:
        """The next message, or None if none came within `timeout_s` or the subscription is closed."""
        if not self._unpacked:
            self._unpacked.extend(message for run in self._runs for message in messages_of_run(run))
            for arrivals in self._by_key.values():
                self._unpacked.extend(message for arrival in arrivals for message in messages_of(arrival))
            self._forget_runs()
        if not self._unpacked:
            arrival = self._inbox.take(timeout_s)
            if arrival is None:
                return None
            self._unpacked.extend(messages_of(arrival))
        return self._unpacked.popleft()

    def receive_run(self, timeout_s: float) -> BusRun | None:
        """The messages of the key that waits longest, or None if none came within `timeout_s` or it is closed."""
        if self._unpacked:
            self._runs.extend(runs_of_messages(self._unpacked))
            self._unpacked.clear()
        if not self._runs:
            self._gather(timeout_s)
            if not self._by_key:
                return None
            arrivals = self._by_key.pop(next(iter(self._by_key)))
            self._gathered -= sum(arrival.count for arrival in arrivals)
            self._runs.extend(runs_of_key(arrivals))
        return self._runs.popleft()

    def _gather(self, timeout_s: float) -> None:
        """What waits sorted by its key, the key that waits longest first; the first may take until the timeout."""
        first = None if self._by_key else self._inbox.take(timeout_s)
        room = TOGETHER_COUNT - self._gathered
        more = self._inbox.take_more(count=room, size_bytes=TOGETHER_BYTES)
        for arrival in more if first is None else (first, *more):
            self._by_key.setdefault((arrival.key, arrival.schema_name), []).append(arrival)
            self._gathered += arrival.count

    def _forget_runs(self) -> None:
        self._runs.clear()
        self._by_key.clear()
        self._gathered = 0

    def close(self) -> None:
        """No more messages; ones not yet received are dropped."""
        self._inbox.close()
        self._unpacked.clear()
        self._forget_runs()
        with contextlib.suppress(zenoh.ZError):  # already undeclared, or its session is gone
            self._subscriber.undeclare()  # type: ignore[no-untyped-call]
        self._callback.join()


class ZenohNews:
    """Word of messages of one expression; made by ZenohBus.news."""

    def __init__(self, session: zenoh.Session, key_expression: str) -> None:
        self._bell = Bell()
        self._callback: JoinedCallback[zenoh.Sample] = JoinedCallback(lambda _: self._bell.ring())
        self._subscriber = session.declare_subscriber(key_expression, self._callback.handler)

    def wait(self, timeout_s: float) -> bool:
        """Whether something came since the last time, or comes within `timeout_s`."""
        return self._bell.wait(timeout_s)

    def close(self) -> None:
        """No more news."""
        self._bell.silence()
        with contextlib.suppress(zenoh.ZError):  # already undeclared, or its session is gone
            self._subscriber.undeclare()  # type: ignore[no-untyped-call]
        self._callback.join()


class ZenohClaim:
    """A claimed key, a liveliness token; made by ZenohBus.claim."""

    def __init__(self, token: zenoh.LivelinessToken) -> None:
        self._token = token

    def release(self) -> None:
        """The key no longer claimed."""
        with contextlib.suppress(zenoh.ZError):  # already undeclared, or its session is gone
            self._token.undeclare()  # type: ignore[no-untyped-call]


class ZenohBus:
    """A Zenoh session. Publishers are reliable, wait when the link is congested, and are kept one a key."""

    def __init__(self, settings: ZenohSettings) -> None:
        self._settings = settings
        self._lock = threading.Lock()
        self._publishers: dict[tuple[str, str], zenoh.Publisher] = {}
        self._subscriptions: list[ZenohSubscription | ZenohNews] = []
        self._claims: list[ZenohClaim] = []
        self._queryables: list[ZenohQueryable] = []
        try:
            self._session = zenoh.open(session_config(settings))
        except zenoh.ZError as error:
            raise ServiceError(f"no Zenoh session with {settings}: {error}") from error

    def publish(self, message: BusMessage) -> None:
        """The message handed to Zenoh; no promise that anyone got it."""
        self._put(message.key, message.schema_name, message.payload, _attachment(message))

    def publish_all(self, messages: Sequence[BusMessage]) -> None:
        """The messages handed to Zenoh, those of one key and schema in bundles; only they keep their order."""
        groups: dict[tuple[str, str], list[BusMessage]] = {}
        for message in messages:
            groups.setdefault((message.key, message.schema_name), []).append(message)
        for group in groups.values():
            for start, stop in _bundles([message.payload for message in group]):
                self._put_bundle(group[start:stop])

    def _put_bundle(self, messages: Sequence[BusMessage]) -> None:
        attachment, payload = encode_bundle([(_attachment(message), message.payload) for message in messages])
        self._put(messages[0].key, messages[0].schema_name, payload, attachment)

    def publish_run(self, run: BusRun) -> None:
        """The run handed to Zenoh in bundles."""
        rows = run.run
        attachments = run_attachments(rows, schema_version=run.schema_version)
        for start, stop in _bundles(rows.payloads):
            parts = list(zip(attachments[start:stop], rows.payloads[start:stop], strict=True))
            attachment, payload = encode_bundle(parts)
            self._put(run.key, rows.schemas[0], payload, attachment)

    def _put(self, key: str, schema_name: str, payload: bytes, attachment: bytes) -> None:
        publisher = self._publisher(key, schema_name)
        try:
            publisher.put(payload, attachment=attachment)
        except zenoh.ZError as error:
            raise ServiceError(f"nothing could be published on {key}: {error}") from error

    def _publisher(self, key: str, schema_name: str) -> zenoh.Publisher:
        self._require_open()
        with self._lock:
            found = self._publishers.get((key, schema_name))
            if found is None:
                found = self._session.declare_publisher(
                    checked_key(key),
                    encoding=encoding_of(PROTOBUF, schema_name),
                    congestion_control=zenoh.CongestionControl.BLOCK,
                    reliability=zenoh.Reliability.RELIABLE,
                )
                self._publishers[key, schema_name] = found
            return found

    def subscribe(self, key_expression: str) -> ZenohSubscription:
        """A subscription to all keys the expression matches."""
        self._require_open()
        inbox: Inbox[Arrival] = Inbox(self._settings.inbox_capacity, capacity_bytes=self._settings.inbox_bytes)
        subscription = ZenohSubscription(self._session, checked_expression(key_expression), inbox)
        self._subscriptions.append(subscription)
        return subscription

    def news(self, key_expression: str) -> ZenohNews:
        """Word of every message on the keys the expression matches."""
        self._require_open()
        news = ZenohNews(self._session, checked_expression(key_expression))
        self._subscriptions.append(news)
        return news

    def queryable(self, key_expression: str) -> ZenohQueryable:
        """Queries on all keys the expression matches."""
        self._require_open()
        queryable = ZenohQueryable(self._session, checked_expression(key_expression))
        self._queryables.append(queryable)
        return queryable

    def get(self, key_expression: str, content: Content, *, timeout_s: float) -> Replies:
        """What every queryable that matches replies."""
        self._require_open()
        try:
            return replies_to(self._session, checked_expression(key_expression), content, timeout_s=timeout_s)
        except zenoh.ZError as error:
            raise ServiceError(f"nothing could be asked on {key_expression}: {error}") from error

    def await_queryable(self, key: str, timeout_s: float) -> bool:
        """Whether Zenoh knows of a queryable that matches the key, at once or within `timeout_s`."""
        self._require_open()
        there = threading.Event()
        querier = self._session.declare_querier(checked_key(key), target=zenoh.QueryTarget.ALL)
        callback = _matching(there)
        changes = querier.declare_matching_listener(callback.handler)
        try:
            # Typed bool in zenoh 1.10's stubs, in truth a MatchingStatus, which is always true as a condition.
            return cast(zenoh.MatchingStatus, querier.matching_status).matching or there.wait(timeout_s)
        finally:
            changes.undeclare()  # type: ignore[no-untyped-call]
            callback.join()
            querier.undeclare()  # type: ignore[no-untyped-call]

    def claim(self, key: str) -> ZenohClaim:
        """The key claimed by a liveliness token: gone when the session's links are."""
        self._require_open()
        try:
            claim = ZenohClaim(self._session.liveliness().declare_token(checked_key(key)))
        except zenoh.ZError as error:
            raise ServiceError(f"{key} could not be claimed: {error}") from error
        self._claims.append(claim)  # a token that nobody refers to any more is undeclared
        return claim

    def claimed(self, key_expression: str) -> tuple[str, ...]:
        """The keys with a liveliness token that match, of every session reachable now."""
        self._require_open()
        replies = self._session.liveliness().get(checked_expression(key_expression), timeout=CLAIM_LOOK_S)
        return tuple(sorted({str(reply.ok.key_expr) for reply in replies if reply.ok is not None}))

    def has_listener(self, key: str) -> bool:
        """Whether Zenoh knows of a subscription that matches the key."""
        # Typed bool in zenoh 1.10's stubs, in truth a MatchingStatus, which is always true as a condition.
        status = cast(zenoh.MatchingStatus, self._publisher(key, "").matching_status)
        return status.matching

    def await_listener(self, key: str, timeout_s: float) -> bool:
        """Whether Zenoh knows of a subscription that matches the key, at once or within `timeout_s`."""
        heard = threading.Event()
        callback = _matching(heard)
        changes = self._publisher(key, "").declare_matching_listener(callback.handler)
        try:
            return self.has_listener(key) or heard.wait(timeout_s)
        finally:
            changes.undeclare()  # type: ignore[no-untyped-call]
            callback.join()

    def close(self) -> None:
        """The session, its publishers and subscriptions ended: an open one would hang the interpreter's exit."""
        for subscription in self._subscriptions:
            subscription.close()
        for claim in self._claims:
            claim.release()
        for queryable in self._queryables:
            queryable.close()
        self._queryables.clear()
        self._subscriptions.clear()
        self._claims.clear()
        self._publishers.clear()
        if not self._session.is_closed():
            self._session.close()  # type: ignore[no-untyped-call]

    def _require_open(self) -> None:
        if self._session.is_closed():
            raise ServiceError("the bus is closed: nothing can be published or subscribed on it any more")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _matching(there: threading.Event) -> JoinedCallback[zenoh.MatchingStatus]:
    return JoinedCallback(lambda status: there.set() if status.matching else None)


def _bundles(payloads: Sequence[bytes]) -> Iterator[tuple[int, int]]:
    """Half-open ranges of payloads to be sent together."""
    start, size_bytes = 0, 0
    for index, payload in enumerate(payloads):
        if index > start and (index - start >= BUNDLE_COUNT or size_bytes + len(payload) > BUNDLE_BYTES):
            yield start, index
            start, size_bytes = index, 0
        size_bytes += len(payload)
    if start < len(payloads):
        yield start, len(payloads)
