"""Many events of one drive column by column: as fast to check, to append and to send as they came."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.codec import Event, decode, encode
from trigpoint.events.envelope import Envelope, EventIdentity, LogPosition

Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class EncodedRun:
    """Messages of one source and boot, row by row: which of `schemas` (n,) as index, sequence (n,), stamp in ns (n,),
    and the Protobuf bytes.
    """

    source: str
    boot_id: str
    schemas: tuple[str, ...]
    schema_of_row: Integers
    sequences: Integers
    stamps_ns: Integers
    payloads: Sequence[bytes]

    def __len__(self) -> int:
        return len(self.payloads)

    def part(self, start: int, stop: int) -> "EncodedRun":
        """The rows [start, stop)."""
        return EncodedRun(
            source=self.source,
            boot_id=self.boot_id,
            schemas=self.schemas,
            schema_of_row=self.schema_of_row[start:stop],
            sequences=self.sequences[start:stop],
            stamps_ns=self.stamps_ns[start:stop],
            payloads=self.payloads[start:stop],
        )

    def picked(self, rows: Integers) -> "EncodedRun":
        """The rows of these numbers, in their order."""
        payloads = self.payloads
        return EncodedRun(
            source=self.source,
            boot_id=self.boot_id,
            schemas=self.schemas,
            schema_of_row=self.schema_of_row[rows],
            sequences=self.sequences[rows],
            stamps_ns=self.stamps_ns[rows],
            payloads=[payloads[row] for row in rows.tolist()],
        )


@dataclass(frozen=True, slots=True)
class LoggedRun:
    """Events that stand in the log one behind the other, undecoded, and where the first one does."""

    position: LogPosition
    run: EncodedRun

    @property
    def next_number(self) -> int:
        """The number after the last one's."""
        return self.position.number + len(self.run)

    def part(self, start: int, stop: int) -> "LoggedRun":
        """The events [start, stop)."""
        return LoggedRun(LogPosition(self.position.stream, self.position.number + start), self.run.part(start, stop))


def joined(runs: Sequence[EncodedRun]) -> EncodedRun:
    """The rows of runs of one source and boot, at least one run, one behind the other."""
    if len(runs) == 1:
        return runs[0]
    number_of = {schema: number for number, schema in enumerate(dict.fromkeys(s for run in runs for s in run.schemas))}
    renumbered = [np.array([number_of[schema] for schema in run.schemas], dtype=np.int64) for run in runs]
    return EncodedRun(
        source=runs[0].source,
        boot_id=runs[0].boot_id,
        schemas=tuple(number_of),
        schema_of_row=np.concatenate([new[run.schema_of_row] for new, run in zip(renumbered, runs, strict=True)]),
        sequences=np.concatenate([run.sequences for run in runs]),
        stamps_ns=np.concatenate([run.stamps_ns for run in runs]),
        payloads=[payload for run in runs for payload in run.payloads],
    )


def encoded(envelope: Envelope[Event]) -> EncodedRun:
    """An event as a run of one. Raises EventRejected for a value its schema cannot hold."""
    schema, payload = encode(envelope.event)
    return EncodedRun(
        source=envelope.identity.source,
        boot_id=envelope.identity.boot_id,
        schemas=(schema,),
        schema_of_row=np.zeros(1, dtype=np.int64),
        sequences=np.array([envelope.identity.sequence], dtype=np.int64),
        stamps_ns=np.array([envelope.stamp_ns], dtype=np.int64),
        payloads=(payload,),
    )


def envelopes(run: EncodedRun) -> Iterator[Envelope[Event]]:
    """The events of a run. Raises EventRejected for a payload that does not hold its schema."""
    rows = zip(run.schema_of_row.tolist(), run.sequences.tolist(), run.stamps_ns.tolist(), run.payloads, strict=True)
    for schema, sequence, stamp_ns, payload in rows:
        event = decode(run.schemas[schema], payload)
        yield Envelope(EventIdentity(run.source, run.boot_id, sequence), stamp_ns, event)
