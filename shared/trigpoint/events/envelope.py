"""What every event carries besides its content: who said it, as which of theirs, and when it was measured."""

from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

EventT = TypeVar("EventT", covariant=True)


@dataclass(frozen=True, slots=True)
class EventIdentity:
    """Names one event for ever; the same identity sent again is the same event.

    `source` is a vehicle's or a service's name, `boot_id` changes whenever the source starts numbering
    anew, `sequence` counts its events of that boot from 0 without gaps.
    """

    source: str
    boot_id: str
    sequence: int


@dataclass(frozen=True, slots=True)
class Envelope(Generic[EventT]):
    """An event with its identity and its time of measurement, integer nanoseconds since the Unix epoch."""

    identity: EventIdentity
    stamp_ns: int
    event: EventT


@dataclass(frozen=True, slots=True, order=True)
class LogPosition:
    """Where an event stands in the log: its stream and its number in that stream, from 0."""

    stream: str
    number: int


class EncodedMessage(Protocol):
    """A message as its sender numbered it, from the bus, a file or a program: payload in the Protobuf schema
    `schema_name`, with what its sender says of it; nobody has looked whether that is true."""

    @property
    def schema_name(self) -> str:
        """The full name of the payload's Protobuf message."""

    @property
    def payload(self) -> bytes:
        """The Protobuf bytes."""

    @property
    def identity(self) -> EventIdentity:
        """Who says it, as which of theirs."""

    @property
    def stamp_ns(self) -> int:
        """When it was measured, integer nanoseconds since the Unix epoch."""
