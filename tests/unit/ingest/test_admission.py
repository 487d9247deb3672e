"""What the log has is not taken twice, and what it has refused may come again mended."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trigpoint.bus.ports import BusMessage
from trigpoint.errors import EventRejected
from trigpoint.events.codec import Event, encode
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import GnssFixReceived, VehicleDescribed
from trigpoint_ingest.core.admission import Admission
from trigpoint_ingest.core.refusal import refusal_of, refused_identity

T0 = 1_700_000_000_000_000_000  # ns
FIX = GnssFixReceived(lat_deg=-33.8, lon_deg=151.2, height_m=math.nan, sigma_m=3.0)
DESCRIBED = VehicleDescribed(vehicle="veh-a")
DRIVE = ("veh-a", "boot")


def message(event: Event, sequence: int) -> BusMessage:
    schema_name, payload = encode(event)
    identity = EventIdentity(*DRIVE, sequence)
    return BusMessage(key="k", schema_name=schema_name, payload=payload, identity=identity, stamp_ns=T0 + sequence)


def admission_with(*sequences: int) -> Admission:
    admission = Admission()
    admission.recall(Envelope(EventIdentity(*DRIVE, 0), T0, DESCRIBED))
    for sequence in sequences:
        admission.admit(message(FIX, sequence))
    return admission


def test_a_message_is_admitted_once() -> None:
    admission = admission_with()
    assert admission.admit(message(FIX, 1)) is not None
    assert admission.admit(message(FIX, 1)) is None


def test_what_is_recalled_from_the_log_is_a_duplicate() -> None:
    assert admission_with().admit(message(DESCRIBED, 0)) is None


def test_a_recalled_description_makes_its_drive_known() -> None:
    assert admission_with().admit(message(FIX, 1)) is not None


def test_another_boot_of_the_vehicle_has_to_describe_itself() -> None:
    other = replace(message(FIX, 1), identity=EventIdentity("veh-a", "boot 2", 1))
    with pytest.raises(EventRejected, match="unknown vehicle"):
        admission_with().admit(other)


def test_a_refused_message_may_come_again_mended() -> None:
    admission = admission_with()
    bad = message(replace(FIX, lat_deg=91.0), 1)
    with pytest.raises(EventRejected):
        admission.admit(bad)
    admission.refuse(bad.identity)
    assert admission.admit(message(FIX, 1)) is not None


def test_a_refusal_is_new_once() -> None:
    admission = Admission()
    assert admission.refuse(EventIdentity(*DRIVE, 4))
    assert not admission.refuse(EventIdentity(*DRIVE, 4))


def test_nothing_is_acknowledged_of_a_drive_never_heard() -> None:
    assert Admission().acknowledged(DRIVE) == -1


@given(accepted=st.sets(st.integers(1, 30)), refused=st.sets(st.integers(1, 30)))
def test_acknowledged_is_all_up_to_the_first_neither_accepted_nor_refused(
    accepted: set[int], refused: set[int]
) -> None:
    admission = admission_with(*sorted(accepted))
    for sequence in refused:
        admission.refuse(EventIdentity(*DRIVE, sequence))
    first_missing = min(set(range(32)) - accepted - refused - {0})
    assert admission.acknowledged(DRIVE) == first_missing - 1


def test_a_refusal_names_the_message_it_is_about() -> None:
    refused = message(FIX, 7)
    refusal = refusal_of(refused, EventRejected("out of range", "why"), payload_limit=10, number=0)
    assert refused_identity(refusal) == refused.identity


def test_a_refusal_keeps_reason_and_payload_up_to_the_limit() -> None:
    refused = message(FIX, 7)
    event = refusal_of(refused, EventRejected("out of range", "why"), payload_limit=10, number=0).event
    assert (event.reason, event.detail, event.schema_name) == ("out of range", "why", "foxglove.LocationFix")
    assert event.payload == refused.payload[:10]


def test_a_refusal_of_a_message_without_identity_is_numbered() -> None:
    anonymous = replace(message(FIX, 0), identity=EventIdentity("", "", -1), stamp_ns=-5)
    refusal = refusal_of(anonymous, EventRejected("unidentified", ""), payload_limit=10, number=42)
    assert (refusal.identity.sequence, refusal.stamp_ns) == (42, 0)
