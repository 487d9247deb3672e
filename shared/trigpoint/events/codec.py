"""The wire form of events: Protobuf payloads and the names of their schemas.

A GNSS fix is a foxglove.LocationFix, a sweep of points a foxglove.PointCloud, every other event the message of
its own name in package trigpoint.v1.
Identity and time of measurement are not part of a payload: whatever carries it carries them.
"""

from collections.abc import Callable, Mapping
from typing import Any

from google.protobuf.message import DecodeError, Message

from trigpoint.errors import EventRejected
from trigpoint.events.corrected import Corrected
from trigpoint.events.estimated import Estimated
from trigpoint.events.forms import FORMS, Form
from trigpoint.events.mapped import Mapped, OdometryCorrected
from trigpoint.events.observed import EventRefused, MapFramePinned, Observed

Event = Observed | EventRefused | MapFramePinned | Corrected | Estimated | Mapped | OdometryCorrected

CURRENT_VERSION = 1  # of the package trigpoint.v<version>

_WRITING: Mapping[type, tuple[str, Callable[[Any], Message]]] = {
    form.event_class: (form.message_class.DESCRIPTOR.full_name, form.message_of) for form in FORMS
}
_READING: Mapping[str, tuple[Callable[[bytes], Any], Callable[[Any], Event]]] = {
    form.message_class.DESCRIPTOR.full_name: (form.message_class.FromString, form.event_of) for form in FORMS
}
_BY_SCHEMA: Mapping[str, Form[Any, Any]] = {form.message_class.DESCRIPTOR.full_name: form for form in FORMS}


def encode(event: Event) -> tuple[str, bytes]:
    """The event's schema name and payload. Raises EventRejected for a value its schema cannot hold."""
    schema, message_of = _WRITING[type(event)]
    try:
        return schema, message_of(event).SerializeToString()
    except (ValueError, TypeError) as error:
        raise EventRejected("unencodable", f"{type(event).__name__}: {error}") from error


def decode(schema: str, payload: bytes) -> Event:
    """The event a payload holds, equal to the one encoded. Raises EventRejected, "unknown schema" or "undecodable"."""
    reading = _READING.get(schema)
    if reading is None:
        raise EventRejected("unknown schema", f"{schema!r} is none of {len(_READING)} known")
    message_from, event_of = reading
    try:
        return event_of(message_from(payload))
    except DecodeError as error:
        raise EventRejected("undecodable", f"{schema}, {len(payload)} bytes: {error}") from error


def event_classes() -> tuple[type, ...]:
    """All classes of events."""
    return tuple(_WRITING)


def event_class(schema: str) -> type | None:
    """The class of events a schema holds, None for an unknown schema."""
    form = _BY_SCHEMA.get(schema)
    return form.event_class if form else None


def schema_name(event_class: type) -> str:
    """The full name of the Protobuf message a class of events is written as."""
    return _WRITING[event_class][0]


def schema_version(schema: str) -> int:
    """The version a schema's package names (`trigpoint.v1.…`), 1 for Foxglove's, 0 for an unknown schema."""
    return CURRENT_VERSION if schema in _BY_SCHEMA else 0


def message_class(schema: str) -> type[Message]:
    """The Protobuf class of a known schema. Raises EventRejected, "unknown schema"."""
    form = _BY_SCHEMA.get(schema)
    if form is None:
        raise EventRejected("unknown schema", f"{schema!r} is none of {len(_BY_SCHEMA)} known")
    found: type[Message] = form.message_class
    return found
