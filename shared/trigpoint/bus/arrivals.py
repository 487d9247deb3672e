"""What one transmission holds: a message, or a bundle of them, read one by one or column by column."""

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from trigpoint.bus.attachment import (
    BUNDLE_LIMIT,
    Bytes,
    attachment_columns,
    attachment_table,
    bundle_stride,
    bundled_count,
    decode_attachment,
    decode_bundle,
    is_bundle,
    uniform_bundle,
)
from trigpoint.bus.ports import UNIDENTIFIED, BusMessage, BusRun
from trigpoint.errors import InputError
from trigpoint.events.envelope import EventIdentity
from trigpoint.events.runs import EncodedRun


@dataclass(frozen=True, slots=True)
class Arrival:
    """A transmission's content, copied out of the transport's buffers."""

    key: str
    schema_name: str
    payload: bytes
    attachment: bytes

    @property
    def count(self) -> int:
        """How many messages it holds."""
        return bundled_count(self.attachment, self.payload)


def messages_of(arrival: Arrival) -> list[BusMessage]:
    """What arrived in one transmission, at least one; as one UNIDENTIFIED message whatever is not ours."""
    bundled = _bundled(arrival)
    if bundled is None:
        return [_message(arrival, arrival.attachment, arrival.payload)]
    attachments, payloads = bundled
    return [_message(arrival, attachment, payload) for attachment, payload in zip(attachments, payloads, strict=True)]


def runs_of(arrival: Arrival) -> list[BusRun]:
    """The same, column by column: a run for each stretch of messages of one source, boot and schema version."""
    bundled = _bundled_table(arrival)
    run = None if bundled is None else _run_of_table(arrival, *bundled)
    return list(runs_of_messages(messages_of(arrival))) if run is None else [run]


def runs_of_key(arrivals: Sequence[Arrival]) -> Iterator[BusRun]:
    """What transmissions of one key and schema hold, in their order: bundles in one run where they make one."""
    for stride, stretch in groupby(arrivals, key=_stride):
        bundles = list(stretch)
        together = _run_of_all(bundles) if stride and len(bundles) > 1 else None
        if together is not None:
            yield together
        else:
            yield from (run for bundle in bundles for run in runs_of(bundle))


def _stride(arrival: Arrival) -> int:
    """Bytes of a bundle's messages, where all may be as long as the first; 0 for any other transmission."""
    return bundle_stride(arrival.payload) if is_bundle(arrival.attachment) else 0


def _run_of_all(bundles: Sequence[Arrival]) -> BusRun | None:
    """Bundles of one key, schema and stride as one run; None where they are not of one drive and schema version."""
    if sum(bundle.count for bundle in bundles) > BUNDLE_LIMIT:
        return None
    table = uniform_bundle(b"".join(bundle.payload for bundle in bundles))
    return None if table is None else _run_of_table(bundles[0], *table)


def _run_of_table(arrival: Arrival, table: Bytes, payloads: Sequence[bytes]) -> BusRun | None:
    """Messages with these attachments (n, L), on the key of an arrival; None where they do not make one run."""
    columns = attachment_columns(table)
    if columns is None:
        return None
    identity, schema_version, sequences, stamps_ns = columns
    run = EncodedRun(
        source=identity.source,
        boot_id=identity.boot_id,
        schemas=(arrival.schema_name,),
        schema_of_row=np.zeros(len(payloads), dtype=np.int64),
        sequences=sequences,
        stamps_ns=stamps_ns,
        payloads=payloads,
    )
    return BusRun(arrival.key, schema_version, run)


def runs_of_messages(messages: Sequence[BusMessage]) -> Iterator[BusRun]:
    """Messages as runs, in their order."""
    for _, stretch in groupby(messages, key=_shared):
        yield run_of_messages(list(stretch))


def messages_of_run(run: BusRun) -> Iterator[BusMessage]:
    """The messages of a run, in their order."""
    rows = run.run
    columns = zip(
        rows.schema_of_row.tolist(), rows.sequences.tolist(), rows.stamps_ns.tolist(), rows.payloads, strict=True
    )
    for schema, sequence, stamp_ns, payload in columns:
        yield BusMessage(
            key=run.key,
            schema_name=rows.schemas[schema],
            payload=payload,
            identity=EventIdentity(rows.source, rows.boot_id, sequence),
            stamp_ns=stamp_ns,
            schema_version=run.schema_version,
        )


def run_of_messages(messages: Sequence[BusMessage]) -> BusRun:
    """Messages of one key, schema, source and boot, at least one, as a run. Raises InputError for a sequence or stamp
    beyond 64 bits."""
    first = messages[0]
    try:
        run = EncodedRun(
            source=first.identity.source,
            boot_id=first.identity.boot_id,
            schemas=(first.schema_name,),
            schema_of_row=np.zeros(len(messages), dtype=np.int64),
            sequences=np.array([message.identity.sequence for message in messages], dtype=np.int64),
            stamps_ns=np.array([message.stamp_ns for message in messages], dtype=np.int64),
            payloads=[message.payload for message in messages],
        )
    except OverflowError as error:
        raise InputError(f"{first.identity} at {first.stamp_ns} ns: {error}") from error
    return BusRun(first.key, first.schema_version, run)


def _shared(message: BusMessage) -> tuple[object, ...]:
    identity = message.identity
    return message.key, message.schema_name, message.schema_version, identity.source, identity.boot_id


def _bundled(arrival: Arrival) -> tuple[list[bytes], list[bytes]] | None:
    """Attachments and payloads of a bundle; None for anything else, and for one nobody of ours would send."""
    if not is_bundle(arrival.attachment):
        return None
    with contextlib.suppress(InputError):
        attachments, payloads = decode_bundle(arrival.payload)
        if 0 < len(payloads) <= BUNDLE_LIMIT:
            return attachments, payloads
    return None


def _bundled_table(arrival: Arrival) -> tuple[Bytes, list[bytes]] | None:
    """The same, the attachments as rows (n, L); None also where they are not all of one length."""
    uniform = uniform_bundle(arrival.payload) if is_bundle(arrival.attachment) else None
    if uniform is not None and 0 < len(uniform[1]) <= BUNDLE_LIMIT:
        return uniform
    bundled = _bundled(arrival)
    table = None if bundled is None else attachment_table(bundled[0])
    return None if bundled is None or table is None else (table, bundled[1])


def _message(arrival: Arrival, attachment: bytes, payload: bytes) -> BusMessage:
    try:
        identity, stamp_ns, schema_version = decode_attachment(attachment)
    except InputError:  # a foreign sender: delivered as UNIDENTIFIED, so that the receiver can refuse and keep it
        identity, stamp_ns, schema_version = UNIDENTIFIED, 0, 0
    return BusMessage(
        key=arrival.key,
        schema_name=arrival.schema_name,
        payload=payload,
        identity=identity,
        stamp_ns=stamp_ns,
        schema_version=schema_version,
    )
