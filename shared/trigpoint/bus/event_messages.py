"""Events as they travel."""

from trigpoint.bus.ports import BusMessage
from trigpoint.events.codec import Event, encode
from trigpoint.events.envelope import Envelope


def event_message(envelope: Envelope[Event], *, key: str) -> BusMessage:
    """The event on a key, with its identity and its time of measurement."""
    schema_name, payload = encode(envelope.event)
    return BusMessage(
        key=key, schema_name=schema_name, payload=payload, identity=envelope.identity, stamp_ns=envelope.stamp_ns
    )
