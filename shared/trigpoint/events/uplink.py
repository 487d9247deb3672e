"""How a vehicle talks to ingest before its events are in the log: the keys it sends on, and the acknowledgement.

What a vehicle sends is not yet an event: it may be lost, sent twice or refused. It goes on `…/veh/<vehicle>/up/…`,
so that whoever subscribes to `…/obs/…` hears only what is in the log.
"""

from trigpoint.errors import InputError
from trigpoint.events.keys import DEFAULT_ROOT, KEY_PATTERNS, KEY_VERSION, valid_name

OBSERVED, SENT = "/obs/", "/up/"
VEHICLE_CLAIM, FLEET_CLAIM = "ingest", "ingest-of-all"
UNKNOWN_PATTERN = "veh/{vehicle}/obs/unknown"

ACKNOWLEDGEMENT_SCHEMA = "trigpoint.v1.Acknowledgement"
"""An empty message: its identity (vehicle, boot, sequence) says it all. Every message of that boot up to and
including the sequence was made durable or refused for good; sequence -1 for none yet."""

DROPPED_SCHEMA = "trigpoint.v1.Dropped"
"""Stands, with an empty payload, for a message its vehicle no longer has: one dropped from a full spool, or damaged
there. No event has this schema: ingest refuses it under its identity, and so acknowledges what comes after it."""


def uplink_key(vehicle: str, event_class: type | None, *, root: str = DEFAULT_ROOT) -> str:
    """The key a vehicle sends its observations of a class on, None for what no class is known for.

    Raises InputError for a name that cannot be a chunk of a key, and for a class that vehicles do not send.
    """
    pattern = KEY_PATTERNS[event_class] if event_class is not None else UNKNOWN_PATTERN
    if OBSERVED not in pattern:
        raise InputError(f"{pattern} is not sent by vehicles: only {OBSERVED} is")
    chunks = pattern.replace(OBSERVED, SENT, 1).format(vehicle=valid_name(vehicle))
    return f"{valid_name(root)}/{KEY_VERSION}/{chunks}"


def observation_key(vehicle: str, event_class: type, *, root: str = DEFAULT_ROOT) -> str:
    """The key on which a vehicle's accepted observations of a class are published."""
    return f"{valid_name(root)}/{KEY_VERSION}/{KEY_PATTERNS[event_class].format(vehicle=valid_name(vehicle))}"


def uplink_expression(*, root: str = DEFAULT_ROOT) -> str:
    """The expression that matches whatever any vehicle sends."""
    return f"{valid_name(root)}/{KEY_VERSION}/veh/*/up/*"


def vehicle_expression(vehicle: str, *, root: str = DEFAULT_ROOT) -> str:
    """The expression that matches whatever one vehicle sends."""
    return f"{valid_name(root)}/{KEY_VERSION}/veh/{valid_name(vehicle)}/up/*"


def sender_of(key: str) -> str:
    """The vehicle on whose key a message came."""
    return key.split("/")[3]


def claim_key(vehicle: str | None, claim_id: str, *, root: str = DEFAULT_ROOT) -> str:
    """The key by which an ingest claims a vehicle, None for all of the fleet."""
    name = FLEET_CLAIM if vehicle is None else f"{VEHICLE_CLAIM}/{valid_name(vehicle)}"
    return f"{valid_name(root)}/{KEY_VERSION}/live/{name}/{valid_name(claim_id)}"


def claim_expressions(*, root: str = DEFAULT_ROOT) -> tuple[str, str]:
    """The expressions that match every claim to a vehicle, and to all of the fleet."""
    live = f"{valid_name(root)}/{KEY_VERSION}/live"
    return f"{live}/{VEHICLE_CLAIM}/*/*", f"{live}/{FLEET_CLAIM}/*"


def claimed_by(key: str) -> tuple[str | None, str]:
    """The vehicle a key claims, None for all of the fleet, and the claim's id."""
    *_, kind, name, claim_id = key.split("/")
    return name if kind == VEHICLE_CLAIM else None, claim_id


def acknowledgement_key(vehicle: str, *, root: str = DEFAULT_ROOT) -> str:
    """The key on which a vehicle hears what it need not send again."""
    return f"{valid_name(root)}/{KEY_VERSION}/ack/{valid_name(vehicle)}"
