"""The attachment of a bus message: identity, time of measurement and schema version, as few bytes as will do.

Layout, little-endian: layout version u8, schema version u8, length of source u16, sequence i64, stamp in ns i64,
then source and boot id in UTF-8 one behind the other.
"""

import struct

from trigpoint.errors import InputError
from trigpoint.events.envelope import EventIdentity

LAYOUT_VERSION = 1
_HEAD = struct.Struct("<BBHqq")


def encode_attachment(identity: EventIdentity, *, stamp_ns: int, schema_version: int) -> bytes:
    """The attachment's bytes. Raises InputError for a value that does not fit its field."""
    source = identity.source.encode()
    try:
        head = _HEAD.pack(LAYOUT_VERSION, schema_version, len(source), identity.sequence, stamp_ns)
    except struct.error as error:
        raise InputError(f"{identity} at {stamp_ns} ns, schema version {schema_version}: {error}") from error
    return head + source + identity.boot_id.encode()


def decode_attachment(attachment: bytes) -> tuple[EventIdentity, int, int]:
    """Identity, stamp in ns and schema version. Raises InputError for bytes that are no attachment of ours."""
    if len(attachment) < _HEAD.size or attachment[0] != LAYOUT_VERSION:
        raise InputError(f"attachment of {len(attachment)} bytes: not layout {LAYOUT_VERSION} of {_HEAD.size} or more")
    _, schema_version, source_length, sequence, stamp_ns = _HEAD.unpack_from(attachment)
    names_at, boot_id_at = _HEAD.size, _HEAD.size + source_length
    if boot_id_at > len(attachment):
        raise InputError(f"attachment of {len(attachment)} bytes ends inside the source of {source_length} bytes")
    try:
        source, boot_id = attachment[names_at:boot_id_at].decode(), attachment[boot_id_at:].decode()
    except UnicodeDecodeError as error:
        raise InputError(f"attachment names are not UTF-8: {error}") from error
    return EventIdentity(source, boot_id, sequence), stamp_ns, schema_version
