"""How an event's identity is kept in MCAP without touching its payload, so that any MCAP tool decodes it.

One channel for each (topic, schema, source, boot): source, boot and vehicle are the channel's metadata, and
the message's own `sequence` is the event's. MCAP gives it 32 bits; the higher ones are `sequence_base` in the
channel's metadata, so a boot with more events than that goes on in another channel. Both times of a message
are the time of measurement: nothing in a file depends on when it was written. An event's number in its stream
is the file's first number plus the messages before it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import groupby

import numpy as np
from google.protobuf.descriptor import FileDescriptor
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.records import Channel
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.events.codec import Event, encode, event_class, message_class
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.keys import DEFAULT_MAP, KEY_PATTERNS, valid_name, vehicle_of
from trigpoint.events.runs import EncodedRun

SEQUENCE_SPAN = 2**32  # MCAP's Message.sequence is a uint32
STAMP_LIMIT_NS = 2**63  # the catalog's integers are signed
ENCODING = "protobuf"


@dataclass(frozen=True, slots=True)
class ChannelKey:
    """What all messages of one channel share. `vehicle` is empty where events are about none."""

    topic: str
    schema_name: str
    source: str
    boot_id: str
    vehicle: str = ""
    sequence_base: int = 0

    def identity(self, mcap_sequence: int) -> EventIdentity:
        """The identity of the channel's message with this MCAP sequence."""
        return EventIdentity(self.source, self.boot_id, self.sequence_base + mcap_sequence)


@dataclass(frozen=True, slots=True)
class PackedRows:
    """Events ready to be written, at least one: of each row the number of its channel (n,), the MCAP sequence (n,),
    the stamp in ns (n,) and the payload.
    """

    channels: tuple[ChannelKey, ...]
    channel_of_row: NDArray[np.int64]
    mcap_sequences: NDArray[np.int64]
    stamps_ns: NDArray[np.int64]
    payloads: Sequence[bytes]

    def part(self, start: int, stop: int) -> "PackedRows":
        """The rows [start, stop)."""
        return PackedRows(
            self.channels,
            self.channel_of_row[start:stop],
            self.mcap_sequences[start:stop],
            self.stamps_ns[start:stop],
            self.payloads[start:stop],
        )


_Row = tuple[ChannelKey, int, int, bytes]  # channel, MCAP sequence, stamp in ns, payload


def packed_rows(rows: Sequence[Envelope[Event] | EncodedRun]) -> PackedRows:
    """The events as they are written, at least one. Raises InputError for a stamp or sequence no log can hold."""
    number_of: dict[ChannelKey, int] = {}
    parts: list[PackedRows] = []
    for encoded, group in groupby(rows, key=lambda row: isinstance(row, EncodedRun)):
        if encoded:
            parts += [_run_rows(run, number_of) for run in group if isinstance(run, EncodedRun)]
        else:
            parts.append(_table([_row(row) for row in group if isinstance(row, Envelope)], number_of))
    if len(parts) == 1:
        return replace(parts[0], channels=tuple(number_of))
    return PackedRows(
        tuple(number_of),
        np.concatenate([part.channel_of_row for part in parts]),
        np.concatenate([part.mcap_sequences for part in parts]),
        np.concatenate([part.stamps_ns for part in parts]),
        [payload for part in parts for payload in part.payloads],
    )


def _table(rows: Sequence[_Row], number_of: dict[ChannelKey, int]) -> PackedRows:
    return PackedRows(
        (),
        np.array([number_of.setdefault(row[0], len(number_of)) for row in rows], dtype=np.int64),
        np.array([row[1] for row in rows], dtype=np.int64),
        np.array([row[2] for row in rows], dtype=np.int64),
        [row[3] for row in rows],
    )


def _run_rows(run: EncodedRun, number_of: dict[ChannelKey, int]) -> PackedRows:
    if len(run) and (int(run.stamps_ns.min()) < 0 or int(run.sequences.min()) < 0):
        raise InputError(f"{run.source!r}, boot {run.boot_id!r}: a stamp or sequence below 0")
    mcap_sequences = run.sequences % SEQUENCE_SPAN
    bases = run.sequences - mcap_sequences
    channel_of_row = np.zeros(len(run), dtype=np.int64)
    if len(run) and len(run.schemas) == 1 and bases.min() == bases.max():
        channel = _drive_channel(run.schemas[0], run.source, run.boot_id, int(bases[0]))
        channel_of_row += number_of.setdefault(channel, len(number_of))
        return PackedRows((), channel_of_row, mcap_sequences, run.stamps_ns, run.payloads)
    for schema, base in dict.fromkeys(zip(run.schema_of_row.tolist(), bases.tolist(), strict=True)):
        channel = _drive_channel(run.schemas[schema], run.source, run.boot_id, base)
        number = number_of.setdefault(channel, len(number_of))
        channel_of_row[(run.schema_of_row == schema) & (bases == base)] = number
    return PackedRows((), channel_of_row, mcap_sequences, run.stamps_ns, run.payloads)


def _drive_channel(schema_name: str, source: str, boot_id: str, sequence_base: int) -> ChannelKey:
    found = event_class(schema_name)
    if found is None:
        raise InputError(f"{source!r}, boot {boot_id!r}: no event has schema {schema_name!r}")
    return _channel(
        found,
        schema_name,
        source,
        boot_id,
        source,
        sequence_base,
    )


def _row(envelope: Envelope[Event]) -> _Row:
    """The event as it is written. Raises InputError for a stamp or sequence no log can hold."""
    identity, stamp_ns = envelope.identity, envelope.stamp_ns
    if not 0 <= stamp_ns < STAMP_LIMIT_NS:
        raise InputError(f"{identity}: stamp {stamp_ns} ns is outside [0, {STAMP_LIMIT_NS})")
    if not 0 <= identity.sequence < STAMP_LIMIT_NS:
        raise InputError(f"{identity}: sequence {identity.sequence} is outside [0, {STAMP_LIMIT_NS})")
    schema_name, payload = encode(envelope.event)
    mcap_sequence = identity.sequence % SEQUENCE_SPAN
    base = identity.sequence - mcap_sequence
    channel = _channel(
        type(envelope.event),  # type: ignore[arg-type]  # mypy takes a class for unhashable
        schema_name,
        identity.source,
        identity.boot_id,
        vehicle_of(envelope),
        base,
    )
    return channel, mcap_sequence, stamp_ns, payload


@lru_cache(maxsize=4096)  # one for each topic and boot of a run: hardly ever made twice
def _channel(
    event_class: type, schema_name: str, source: str, boot_id: str, vehicle: str, sequence_base: int
) -> ChannelKey:
    """The channel of a class of events; its topic is the key's pattern filled in, a landmark's without its tile."""
    pattern = KEY_PATTERNS[event_class].partition("/{zoom}")[0]
    about = valid_name(vehicle) if "{vehicle}" in pattern else ""
    topic = pattern.format(vehicle=about, map=DEFAULT_MAP)
    return ChannelKey(topic, schema_name, source, boot_id, about, sequence_base)


def channel_record(key: ChannelKey, *, channel_id: int, schema_id: int) -> Channel:
    """The MCAP channel of a key."""
    metadata = {"source": key.source, "boot_id": key.boot_id}
    if key.vehicle:
        metadata["vehicle"] = key.vehicle
    if key.sequence_base:
        metadata["sequence_base"] = str(key.sequence_base)
    return Channel(id=channel_id, topic=key.topic, message_encoding=ENCODING, metadata=metadata, schema_id=schema_id)


def channel_key(channel: Channel, *, schema_name: str) -> ChannelKey:
    """The key of an MCAP channel, also of a foreign one: source and boot are empty where it names none.

    Raises ValueError for a sequence base that is no number.
    """
    metadata = channel.metadata
    return ChannelKey(
        topic=channel.topic,
        schema_name=schema_name,
        source=metadata.get("source", ""),
        boot_id=metadata.get("boot_id", ""),
        vehicle=metadata.get("vehicle", ""),
        sequence_base=int(metadata.get("sequence_base", "0")),
    )


def schema_data(schema_name: str) -> bytes:
    """The Protobuf FileDescriptorSet of a known schema with all it imports, dependencies first."""
    descriptors = FileDescriptorSet()
    file: FileDescriptor = message_class(schema_name).DESCRIPTOR.file  # type: ignore[assignment]  # its C twin
    _add_file(descriptors, file, set())
    return descriptors.SerializeToString(deterministic=True)


def _add_file(descriptors: FileDescriptorSet, file: FileDescriptor, added: set[str]) -> None:
    if file.name in added:
        return
    added.add(file.name)
    for imported in file.dependencies:
        _add_file(descriptors, imported, added)
    file.CopyToProto(descriptors.file.add())
