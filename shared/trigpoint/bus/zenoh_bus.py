"""The bus on Zenoh: the fast path between processes and machines; zenoh's one home."""

import contextlib
import json
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Self, cast

import zenoh

from trigpoint.bus.attachment import (
    bundled_count,
    decode_attachment,
    decode_bundle,
    encode_attachment,
    encode_bundle,
    is_bundle,
)
from trigpoint.bus.inbox import INBOX_CAPACITY, Inbox
from trigpoint.bus.key_expressions import checked_expression, checked_key
from trigpoint.bus.ports import UNIDENTIFIED, BusMessage
from trigpoint.errors import InputError, ServiceError

PROTOBUF = "application/protobuf"
BUNDLE_LIMIT = 256  # messages in a transmission: some 15 kB of IMU, below the 64 kB a Zenoh batch holds


@dataclass(frozen=True, slots=True, kw_only=True)
class ZenohSettings:
    """A peer's endpoints such as "tcp/127.0.0.1:7447"; scouting finds peers without endpoints, by multicast."""

    listen: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()
    mode: str = "peer"
    scouting: bool = False
    inbox_capacity: int = INBOX_CAPACITY


def _config(settings: ZenohSettings) -> zenoh.Config:
    config = zenoh.Config()
    for name, value in (
        ("mode", settings.mode),
        ("listen/endpoints", list(settings.listen)),
        ("connect/endpoints", list(settings.connect)),
        ("scouting/multicast/enabled", settings.scouting),
        ("scouting/gossip/enabled", settings.scouting),
    ):
        config.insert_json5(name, json.dumps(value))
    return config


def _attachment(message: BusMessage) -> bytes:
    return encode_attachment(message.identity, stamp_ns=message.stamp_ns, schema_version=message.schema_version)


@dataclass(frozen=True, slots=True)
class _Arrival:
    """A sample's content, copied out of the transport's buffers."""

    key: str
    encoding: str
    payload: bytes
    attachment: bytes


def _messages(arrival: _Arrival) -> list[BusMessage]:
    """What arrived in one transmission, at least one; as one UNIDENTIFIED message whatever is not ours."""
    if not is_bundle(arrival.attachment):
        return [_message(arrival, arrival.attachment, arrival.payload)]
    with contextlib.suppress(InputError):
        bundled = [_message(arrival, attachment, payload) for attachment, payload in decode_bundle(arrival.payload)]
        if bundled:  # nobody of ours sends an empty one
            return bundled
    return [_message(arrival, b"", arrival.payload)]


def _message(arrival: _Arrival, attachment: bytes, payload: bytes) -> BusMessage:
    try:
        identity, stamp_ns, schema_version = decode_attachment(attachment)
    except InputError:  # a foreign sender: delivered as UNIDENTIFIED, so that the receiver can refuse and keep it
        identity, stamp_ns, schema_version = UNIDENTIFIED, 0, 0
    return BusMessage(
        key=arrival.key,
        schema_name=arrival.encoding.partition(";")[2],
        payload=payload,
        identity=identity,
        stamp_ns=stamp_ns,
        schema_version=schema_version,
    )


class ZenohSubscription:
    """Messages of one expression; made by ZenohBus.subscribe. The transport's callback only queues them."""

    def __init__(self, session: zenoh.Session, key_expression: str, capacity: int) -> None:
        self._inbox: Inbox[_Arrival] = Inbox(capacity)
        self._unpacked: deque[BusMessage] = deque()
        self._subscriber = session.declare_subscriber(key_expression, self._arrived)

    def _arrived(self, sample: zenoh.Sample) -> None:
        attached = sample.attachment
        attachment = attached.to_bytes() if attached is not None else b""
        arrival = _Arrival(str(sample.key_expr), str(sample.encoding), sample.payload.to_bytes(), attachment)
        self._inbox.offer(arrival, count=bundled_count(attachment, arrival.payload))

    @property
    def lost(self) -> int:
        """How many messages were dropped because the queue was full."""
        return self._inbox.lost

    def receive(self, timeout_s: float) -> BusMessage | None:
        """The next message, or None if none came within `timeout_s` or the subscription is closed."""
        if not self._unpacked:
            arrival = self._inbox.take(timeout_s)
            if arrival is None:
                return None
            self._unpacked.extend(_messages(arrival))
        return self._unpacked.popleft()

    def close(self) -> None:
        """No more messages; ones not yet received are dropped."""
        self._inbox.close()
        self._unpacked.clear()
        with contextlib.suppress(zenoh.ZError):  # already undeclared, or its session is gone
            self._subscriber.undeclare()  # type: ignore[no-untyped-call]


class ZenohBus:
    """A Zenoh session. Publishers are reliable, wait when the link is congested, and are kept one a key."""

    def __init__(self, settings: ZenohSettings) -> None:
        self._settings = settings
        self._lock = threading.Lock()
        self._publishers: dict[tuple[str, str], zenoh.Publisher] = {}
        self._subscriptions: list[ZenohSubscription] = []
        try:
            self._session = zenoh.open(_config(settings))
        except zenoh.ZError as error:
            raise ServiceError(f"no Zenoh session with {settings}: {error}") from error

    def publish(self, message: BusMessage) -> None:
        """The message handed to Zenoh; no promise that anyone got it."""
        self._put(message, message.payload, _attachment(message))

    def publish_all(self, messages: Sequence[BusMessage]) -> None:
        """The messages handed to Zenoh, those of one key and schema in bundles; only they keep their order."""
        groups: dict[tuple[str, str], list[BusMessage]] = {}
        for message in messages:
            groups.setdefault((message.key, message.schema_name), []).append(message)
        for group in groups.values():
            for first in range(0, len(group), BUNDLE_LIMIT):
                self._put_bundle(group[first : first + BUNDLE_LIMIT])

    def _put_bundle(self, messages: Sequence[BusMessage]) -> None:
        attachment, payload = encode_bundle([(_attachment(message), message.payload) for message in messages])
        self._put(messages[0], payload, attachment)

    def _put(self, message: BusMessage, payload: bytes, attachment: bytes) -> None:
        publisher = self._publisher(message.key, message.schema_name)
        try:
            publisher.put(payload, attachment=attachment)
        except zenoh.ZError as error:
            raise ServiceError(f"nothing could be published on {message.key}: {error}") from error

    def _publisher(self, key: str, schema_name: str) -> zenoh.Publisher:
        self._require_open()
        with self._lock:
            found = self._publishers.get((key, schema_name))
            if found is None:
                found = self._session.declare_publisher(
                    checked_key(key),
                    encoding=zenoh.Encoding(PROTOBUF).with_schema(schema_name),
                    congestion_control=zenoh.CongestionControl.BLOCK,
                    reliability=zenoh.Reliability.RELIABLE,
                )
                self._publishers[key, schema_name] = found
            return found

    def subscribe(self, key_expression: str) -> ZenohSubscription:
        """A subscription to all keys the expression matches."""
        self._require_open()
        subscription = ZenohSubscription(
            self._session, checked_expression(key_expression), self._settings.inbox_capacity
        )
        self._subscriptions.append(subscription)
        return subscription

    def has_listener(self, key: str) -> bool:
        """Whether Zenoh knows of a subscription that matches the key."""
        # Typed bool in zenoh 1.10's stubs, in truth a MatchingStatus, which is always true as a condition.
        status = cast(zenoh.MatchingStatus, self._publisher(key, "").matching_status)
        return status.matching

    def await_listener(self, key: str, timeout_s: float) -> bool:
        """Whether Zenoh knows of a subscription that matches the key, at once or within `timeout_s`."""
        heard = threading.Event()
        changes = self._publisher(key, "").declare_matching_listener(
            lambda status: heard.set() if status.matching else None
        )
        try:
            return self.has_listener(key) or heard.wait(timeout_s)
        finally:
            changes.undeclare()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        """The session, its publishers and subscriptions ended: an open one would hang the interpreter's exit."""
        for subscription in self._subscriptions:
            subscription.close()
        self._subscriptions.clear()
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
