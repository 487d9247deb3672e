"""A refused message as an event of its own: kept with its reason, named after the message it was."""

from trigpoint.errors import EventRejected
from trigpoint.events.envelope import EncodedMessage, Envelope, EventIdentity
from trigpoint.events.observed import EventRefused
from trigpoint_ingest.core.limits import TEXT_LIMIT
from trigpoint_ingest.core.stamps import STAMP_LIMIT_NS
from trigpoint_ingest.core.validation import SEQUENCE_LIMIT

REFUSING_SOURCE = "ingest"
SEPARATOR = "/"  # no vehicle's name holds one


def refusal_of(
    message: EncodedMessage, error: EventRejected, *, payload_limit: int, number: int
) -> Envelope[EventRefused]:
    """The refusal, with up to `payload_limit` bytes of the payload.

    Its identity is made of the message's, so that the same message refused again is the same refusal, and the
    message itself may still be accepted later; without an identity of its own it gets `number`.
    """
    identity, source = message.identity, message.identity.source[:TEXT_LIMIT]
    sequence = identity.sequence if 0 <= identity.sequence < SEQUENCE_LIMIT else number
    return Envelope(
        EventIdentity(REFUSING_SOURCE, f"{source}{SEPARATOR}{identity.boot_id[:TEXT_LIMIT]}", sequence),
        message.stamp_ns if 0 <= message.stamp_ns < STAMP_LIMIT_NS else 0,
        EventRefused(
            source=source,
            reason=error.reason,
            detail=error.detail,
            schema_name=message.schema_name[:TEXT_LIMIT],
            payload=message.payload[:payload_limit],
        ),
    )


def refused_identity(refusal: Envelope[EventRefused]) -> EventIdentity:
    """The identity of the message a refusal is about."""
    source = refusal.event.source
    boot_id = refusal.identity.boot_id[len(source) + len(SEPARATOR) :]
    return EventIdentity(source, boot_id, refusal.identity.sequence)
