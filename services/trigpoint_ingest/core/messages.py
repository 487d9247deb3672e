"""A message as it came in, before anyone believes it."""

from collections.abc import Iterator
from dataclasses import dataclass

from trigpoint.events.envelope import EventIdentity
from trigpoint.events.runs import EncodedRun


@dataclass(frozen=True, slots=True)
class RunMessage:
    """One message of a run."""

    schema_name: str
    payload: bytes
    identity: EventIdentity
    stamp_ns: int


def messages_of(run: EncodedRun) -> Iterator[RunMessage]:
    """The messages of a run, one by one."""
    rows = zip(run.schema_of_row.tolist(), run.sequences.tolist(), run.stamps_ns.tolist(), run.payloads, strict=True)
    for schema, sequence, stamp_ns, payload in rows:
        identity = EventIdentity(run.source, run.boot_id, sequence)
        yield RunMessage(run.schemas[schema], payload, identity, stamp_ns)
