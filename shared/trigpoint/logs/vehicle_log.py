"""A vehicle's log: one MCAP file of observations, written whole and read by message, so that one can be refused."""

import contextlib
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from trigpoint.errors import AppendFailed, LogDamaged
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import Observed
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.channels import packed_rows
from trigpoint.logs.chunks import messages
from trigpoint.logs.mcap_scan import Damage, McapScan
from trigpoint.logs.mcap_writer import McapFileWriter

BATCH_ROWS = 4096
BATCH_SWEEPS = 8  # of points among them: some 20 MB
DAMAGES_NAMED = 3  # in an error's message; the rest is counted


@dataclass(frozen=True, slots=True)
class RawMessage:
    """A message as a file holds it, nothing of it checked but the file's checksums."""

    topic: str
    schema_name: str
    payload: bytes
    identity: EventIdentity
    stamp_ns: int


def write_vehicle_log(path: Path, rows: Iterable[Envelope[Observed]], *, vehicle: str, software: str = "") -> int:
    """How many observations were written, in the order given; the file is there whole or not at all.

    Raises AppendFailed if it cannot be written, InputError for a stamp or name no log can hold.
    """
    partial = path.with_name(path.name + ".part")
    metadata = {"vehicle": {"name": vehicle}, "software": {"name": software or "trigpoint"}}
    try:
        with partial.open("wb", buffering=0) as file:
            writer = McapFileWriter(file, metadata=metadata)
            count = sum(_append(writer, batch) for batch in _batches(rows))
            writer.finish()
            os.fsync(file.fileno())
        partial.replace(path)
    except OSError as error:
        raise AppendFailed(f"{path}: vehicle log not written: {error}") from error
    finally:
        with contextlib.suppress(OSError):  # there is none, or what is wrong with it was said already
            partial.unlink()
    return count


def _append(writer: McapFileWriter, batch: Sequence[Envelope[Observed]]) -> int:
    writer.append(packed_rows(batch))
    return len(batch)


def _batches(rows: Iterable[Envelope[Observed]]) -> Iterator[list[Envelope[Observed]]]:
    batch: list[Envelope[Observed]] = []
    sweeps = 0
    for row in rows:
        batch.append(row)
        sweeps += isinstance(row.event, PointsScanned)
        if len(batch) == BATCH_ROWS or sweeps == BATCH_SWEEPS:
            yield batch
            batch, sweeps = [], 0
    if batch:
        yield batch


def read_vehicle_log(path: Path) -> Iterator[RawMessage]:
    """Every whole message of an MCAP file, in its order; then, if anything of it is damaged, raises LogDamaged
    naming file, byte and loss."""
    damages: list[Damage] = []
    yield from read_whole_messages(path, damages)
    if damages:
        more = f" (and {len(damages) - DAMAGES_NAMED} more)" if len(damages) > DAMAGES_NAMED else ""
        raise LogDamaged("; ".join(str(damage) for damage in damages[:DAMAGES_NAMED]) + more)


def read_whole_messages(path: Path, damages: list[Damage]) -> Iterator[RawMessage]:
    """Every whole message of an MCAP file, in its order; what is damaged is added to `damages`.

    Raises LogDamaged if the file cannot be opened.
    """
    scan = McapScan(path)
    try:
        for chunk in scan.chunks():
            yield from _messages(scan, chunk.data, chunk.offset)
    except OSError as error:
        raise LogDamaged(f"{path}: cannot be read: {error}") from error
    damages.extend(scan.damages)


def _messages(scan: McapScan, data: bytes, offset: int) -> Iterator[RawMessage]:
    orphans = 0
    for message in messages(data):
        channel = scan.channels.get(message.channel_id)
        if channel is None:
            orphans += 1
            continue
        identity = channel.identity(message.mcap_sequence)
        yield RawMessage(channel.topic, channel.schema_name, message.payload, identity, message.log_time_ns)
    if orphans:
        scan.damages.append(Damage(scan.path, offset, f"{orphans} messages of a channel that was lost", orphans))
