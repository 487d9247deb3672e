"""The attachment of a bus message: identity, time of measurement and schema version, as few bytes as will do.

Layout, little-endian: layout version u8, schema version u8, length of source u16, sequence i64, stamp in ns i64,
then source and boot id in UTF-8 one behind the other.

A bundle is one transmission of several messages of a key and a schema. Its attachment is layout version 2 and their
number u32; its payload holds for each of them the lengths of attachment and payload, u32 each, and then these two.
"""

import struct
from collections.abc import Iterator, Sequence

from trigpoint.errors import InputError
from trigpoint.events.envelope import EventIdentity

LAYOUT_VERSION = 1
BUNDLE_VERSION = 2
_HEAD = struct.Struct("<BBHqq")
_BUNDLE = struct.Struct("<BI")
_LENGTHS = struct.Struct("<II")


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


def encode_bundle(parts: Sequence[tuple[bytes, bytes]]) -> tuple[bytes, bytes]:
    """Attachment and payload of a bundle of messages, given as attachment and payload each."""
    packed: list[bytes] = []
    for attachment, payload in parts:
        packed += (_LENGTHS.pack(len(attachment), len(payload)), attachment, payload)
    return _BUNDLE.pack(BUNDLE_VERSION, len(parts)), b"".join(packed)


def bundled_count(attachment: bytes, payload: bytes) -> int:
    """How many messages a transmission holds: what a bundle says, as far as its payload has room for them, else 1."""
    said: int = _BUNDLE.unpack(attachment)[1] if is_bundle(attachment) else 1
    return max(min(said, len(payload) // _LENGTHS.size), 1)


def is_bundle(attachment: bytes) -> bool:
    """Whether an attachment is that of a bundle."""
    return len(attachment) == _BUNDLE.size and attachment[0] == BUNDLE_VERSION


def decode_bundle(payload: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Attachment and payload of each message of a bundle. Raises InputError where the bundle ends inside of one."""
    offset, end = 0, len(payload)
    while offset < end:
        if end - offset < _LENGTHS.size:
            raise InputError(f"bundle of {end} bytes ends inside the lengths at {offset}")
        attachment_length, payload_length = _LENGTHS.unpack_from(payload, offset)
        payload_at = offset + _LENGTHS.size + attachment_length
        following = payload_at + payload_length
        if following > end:
            raise InputError(f"bundle of {end} bytes ends inside the message at {offset}, which reaches to {following}")
        yield payload[offset + _LENGTHS.size : payload_at], payload[payload_at:following]
        offset = following
