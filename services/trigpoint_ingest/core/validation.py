"""One message against every rule that does not need its neighbours in the log."""

from typing import get_args

from trigpoint.errors import EventRejected, InputError
from trigpoint.events.codec import decode
from trigpoint.events.envelope import EncodedMessage, Envelope, EventIdentity
from trigpoint.events.keys import valid_name
from trigpoint.events.observed import Observed, VehicleDescribed
from trigpoint_ingest.core.limits import TEXT_LIMIT, within_limits
from trigpoint_ingest.core.stamps import DriveStamps, StampLimits, require_stamp

OBSERVED: frozenset[type] = frozenset(get_args(Observed))
SEQUENCE_LIMIT = 2**63  # signed 64 bits

UNKNOWN_SCHEMA = "unknown schema"
UNKNOWN_VEHICLE = "unknown vehicle"
UNIDENTIFIED = "unidentified"

Drive = tuple[str, str]
"""A vehicle and the boot its drive was numbered in."""


def drive_of(identity: EventIdentity) -> Drive:
    """The drive an event belongs to."""
    return identity.source, identity.boot_id


def validate(
    message: EncodedMessage, *, described: bool, stamps: DriveStamps, limits: StampLimits, fleet: frozenset[str] | None
) -> Envelope[Observed]:
    """The event a message holds, if it may enter the log.

    `described` tells whether the drive's VehicleDescribed was accepted before, `stamps` are the drive's so far;
    `fleet` names the only vehicles allowed, None allows all that describe themselves. Raises EventRejected.
    """
    identity, stamp_ns = message.identity, message.stamp_ns
    _require_identity(identity)
    event = decode(message.schema_name, message.payload)
    if type(event) not in OBSERVED:
        raise EventRejected(UNKNOWN_SCHEMA, f"{message.schema_name!r} is not what a vehicle may send")
    observed: Observed = event  # type: ignore[assignment]  # one of OBSERVED
    if not described or type(event) is VehicleDescribed:
        _require_vehicle(identity, observed, fleet=fleet)
    accepted = within_limits(observed)
    require_stamp(type(accepted), stamp_ns, stamps, limits)
    return Envelope(identity, stamp_ns, accepted)


def _require_identity(identity: EventIdentity) -> None:
    if not 0 <= identity.sequence < SEQUENCE_LIMIT or not identity.source:
        raise EventRejected(UNIDENTIFIED, f"source {identity.source!r}, sequence {identity.sequence}: from 0 on")
    if len(identity.boot_id) > TEXT_LIMIT:
        raise EventRejected(UNIDENTIFIED, f"boot id of {len(identity.boot_id)} characters, limit {TEXT_LIMIT}")


def _require_vehicle(identity: EventIdentity, event: Observed, *, fleet: frozenset[str] | None) -> None:
    """Nothing, if the event is a description by which its drive becomes known."""
    vehicle = identity.source
    if fleet is not None and vehicle not in fleet:
        raise EventRejected(UNKNOWN_VEHICLE, f"{vehicle!r} is not one of the fleet's {len(fleet)}")
    if not isinstance(event, VehicleDescribed):
        raise EventRejected(
            UNKNOWN_VEHICLE, f"{vehicle!r} has not described itself in boot {identity.boot_id!r} before sending"
        )
    if event.vehicle != vehicle:
        raise EventRejected(UNKNOWN_VEHICLE, f"{vehicle!r} describes {event.vehicle!r}")
    try:
        valid_name(vehicle)
    except InputError as error:
        raise EventRejected(UNKNOWN_VEHICLE, str(error)) from error
