"""How a vehicle talks to ingest before its events are in the log: the keys it sends on, and the acknowledgement.

What a vehicle sends is not yet an event: it may be lost, sent twice or refused. It goes on `…/veh/<vehicle>/up/…`,
so that whoever subscribes to `…/obs/…` hears only what is in the log.
"""

from trigpoint.events.envelope import Envelope
from trigpoint.events.keys import DEFAULT_ROOT, KEY_VERSION, key_of, valid_name

ACKNOWLEDGEMENT_SCHEMA = "trigpoint.v1.Acknowledgement"
"""An empty message: its identity (vehicle, boot, sequence) says it all. Every message of that boot up to and
including the sequence was made durable or refused for good; sequence -1 for none yet."""


def uplink_key_of(envelope: Envelope[object], *, root: str = DEFAULT_ROOT) -> str:
    """The key a vehicle sends an observation on. Raises InputError for a name that cannot be a chunk of a key."""
    return key_of(envelope, root=root).replace("/obs/", "/up/", 1)


def uplink_expression(*, root: str = DEFAULT_ROOT) -> str:
    """The expression that matches whatever any vehicle sends."""
    return f"{valid_name(root)}/{KEY_VERSION}/veh/*/up/*"


def acknowledgement_key(vehicle: str, *, root: str = DEFAULT_ROOT) -> str:
    """The key on which a vehicle hears what it need not send again."""
    return f"{valid_name(root)}/{KEY_VERSION}/ack/{valid_name(vehicle)}"
