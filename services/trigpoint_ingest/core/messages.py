"""A message as it came in, before anyone believes it."""

from dataclasses import dataclass

from trigpoint.events.envelope import EventIdentity


@dataclass(frozen=True, slots=True)
class RawMessage:
    """A message of a vehicle: payload in the Protobuf schema `schema_name`, with what its sender says of it."""

    schema_name: str
    payload: bytes
    identity: EventIdentity
    stamp_ns: int
