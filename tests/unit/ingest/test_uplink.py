"""The keys between a vehicle and ingest."""

import pytest

from trigpoint.bus.key_expressions import checked_key, key_matches
from trigpoint.errors import InputError
from trigpoint.events.keys import key_expression
from trigpoint.events.mapped import MapSolved
from trigpoint.events.observed import GnssFixReceived, ImuMeasured
from trigpoint.events.uplink import acknowledgement_key, uplink_expression, uplink_key


def test_a_vehicle_sends_on_keys_of_its_own() -> None:
    assert uplink_key("veh-a", ImuMeasured) == "trigpoint/v1/veh/veh-a/up/imu"
    assert uplink_key("veh-a", None) == "trigpoint/v1/veh/veh-a/up/unknown"


def test_ingest_hears_every_vehicle_and_not_itself() -> None:
    assert key_matches(uplink_expression(root="r"), uplink_key("veh-a", GnssFixReceived, root="r"))
    assert not key_matches(key_expression(GnssFixReceived), uplink_key("veh-a", GnssFixReceived))


def test_a_class_that_vehicles_do_not_send_has_no_key() -> None:
    with pytest.raises(InputError, match="not sent by vehicles"):
        uplink_key("veh-a", MapSolved)


@pytest.mark.parametrize("name", ["", "a/b", "a*", "a?", "#", "$x", "@a"])
def test_no_name_makes_a_key_that_may_not_be_published(name: str) -> None:
    with pytest.raises(InputError):
        uplink_key(name, ImuMeasured)
    with pytest.raises(InputError):
        acknowledgement_key(name)


def test_an_acknowledgements_key_may_be_published() -> None:
    assert checked_key(acknowledgement_key("veh-a")) == "trigpoint/v1/ack/veh-a"
