"""The attachment of a bus message: identity, time of measurement and schema version, as few bytes as will do.

Layout, little-endian: layout version u8, schema version u8, length of source u16, sequence i64, stamp in ns i64,
then source and boot id in UTF-8 one behind the other.

A bundle is one transmission of several messages of a key and a schema. Its attachment is layout version 2 and their
number u32; its payload holds for each of them the lengths of attachment and payload, u32 each, and then these two.
"""

import struct
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.events.envelope import EventIdentity
from trigpoint.events.runs import EncodedRun, Integers

Bytes = NDArray[np.uint8]

LAYOUT_VERSION = 1
BUNDLE_VERSION = 2
BUNDLE_LIMIT = 4096  # messages a receiver unpacks; senders of ours stay far below
_HEAD = struct.Struct("<BBHqq")
_SEQUENCE_AT = 4  # bytes before sequence and stamp
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


def decode_bundle(payload: bytes) -> tuple[list[bytes], list[bytes]]:
    """Attachments and payloads of a bundle's messages. Raises InputError where the bundle ends inside of one."""
    attachments: list[bytes] = []
    payloads: list[bytes] = []
    offset, end, size, unpack = 0, len(payload), _LENGTHS.size, _LENGTHS.unpack_from
    while offset < end:
        if end - offset < size:
            raise InputError(f"bundle of {end} bytes ends inside the lengths at {offset}")
        attachment_length, payload_length = unpack(payload, offset)
        payload_at = offset + size + attachment_length
        following = payload_at + payload_length
        if following > end:
            raise InputError(f"bundle of {end} bytes ends inside the message at {offset}, which reaches to {following}")
        attachments.append(payload[offset + size : payload_at])
        payloads.append(payload[payload_at:following])
        offset = following
    return attachments, payloads


def bundle_stride(payload: bytes) -> int:
    """How long each message of a bundle is, with its lengths and attachment, if all are as long as the first; 0 if
    they cannot be."""
    if len(payload) < _LENGTHS.size:
        return 0
    attachment_length, payload_length = _LENGTHS.unpack_from(payload)
    stride: int = _LENGTHS.size + attachment_length + payload_length
    return 0 if len(payload) % stride else stride


def uniform_bundle(payload: bytes) -> tuple[Bytes, list[bytes]] | None:
    """Attachments (n, L) and payloads of a bundle of messages that are all as long as the first; None for another."""
    stride = bundle_stride(payload)
    if not stride:
        return None
    payload_at = _LENGTHS.size + _LENGTHS.unpack_from(payload)[0]
    table = np.frombuffer(payload, dtype=np.uint8).reshape(-1, stride)
    if (table[:, : _LENGTHS.size] != table[0, : _LENGTHS.size]).any():
        return None
    starts = range(0, len(payload), stride)
    return table[:, _LENGTHS.size : payload_at], [payload[start + payload_at : start + stride] for start in starts]


def attachment_table(attachments: Sequence[bytes]) -> Bytes | None:
    """Attachments (n, L) of one length, or None."""
    length = len(attachments[0])
    if any(len(attachment) != length for attachment in attachments):
        return None
    return np.frombuffer(b"".join(attachments), dtype=np.uint8).reshape(len(attachments), length)


def attachment_columns(table: Bytes) -> tuple[EventIdentity, int, Integers, Integers] | None:
    """Source and boot (in an identity of the first message), schema version, sequences (n,) and stamps in ns (n,) of
    attachments (n, L) that differ in nothing else; None if they do, or are not ours.
    """
    before, behind = table[:, :_SEQUENCE_AT], table[:, _HEAD.size :]
    if (before != before[0]).any() or (behind != behind[0]).any():
        return None
    try:
        identity, _, schema_version = decode_attachment(table[0].tobytes())
    except InputError:
        return None
    numbers = np.ascontiguousarray(table[:, _SEQUENCE_AT : _HEAD.size]).view("<i8").astype(np.int64, copy=False)
    return identity, schema_version, numbers[:, 0], numbers[:, 1]


def run_attachments(run: EncodedRun, *, schema_version: int) -> list[bytes]:
    """The attachment of each message of a run."""
    first = EventIdentity(run.source, run.boot_id, 0)
    template = np.frombuffer(encode_attachment(first, stamp_ns=0, schema_version=schema_version), dtype=np.uint8)
    table = np.tile(template, (len(run), 1))
    numbers = np.stack([run.sequences, run.stamps_ns], axis=1).astype("<i8")
    table[:, _SEQUENCE_AT : _HEAD.size] = numbers.view(np.uint8)
    packed, length = table.tobytes(), len(template)
    return [packed[start : start + length] for start in range(0, len(packed), length)]
