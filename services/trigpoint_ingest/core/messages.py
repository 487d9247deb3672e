"""A message as it came in, before anyone believes it."""

from typing import Protocol

from trigpoint.events.envelope import EventIdentity


class RawMessage(Protocol):
    """A message of a vehicle, from the bus or a file: payload in the Protobuf schema `schema_name`, with what its
    sender says of it."""

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
