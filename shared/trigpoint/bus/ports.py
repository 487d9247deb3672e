"""What a bus can do, whatever carries it."""

from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

from trigpoint.events.envelope import EventIdentity


@dataclass(frozen=True, slots=True, kw_only=True)
class BusMessage:
    """One message: `key` as in dataflow, payload in the Protobuf schema `schema_name`, identity and time of measurement."""

    key: str
    schema_name: str
    payload: bytes
    identity: EventIdentity
    stamp_ns: int


class Subscription(Protocol):
    """Messages that arrived for one key expression, in order of arrival."""

    def receive(self, timeout_s: float) -> BusMessage | None:
        """The next message, or None if none came within `timeout_s`."""

    def close(self) -> None:
        """No more messages; ones not yet received are dropped."""


class Bus(Protocol):
    """Publishes and subscribes; a context manager, so that it is always closed."""

    def publish(self, message: BusMessage) -> None:
        """The message handed to the transport; no promise that anyone got it."""

    def subscribe(self, key_expression: str) -> Subscription:
        """A subscription to all keys the expression matches (`*` one chunk, `**` any number)."""

    def close(self) -> None:
        """The session ended."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
