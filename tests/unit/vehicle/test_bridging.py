"""What a receiver lost after it had acknowledged it is told to be gone, number by number."""

import pytest

from trigpoint.events.envelope import EventIdentity
from trigpoint.events.uplink import DROPPED_SCHEMA
from trigpoint_vehicle.core.bridging import BRIDGED_TOGETHER, bridge
from trigpoint_vehicle.core.outgoing import Outgoing, SendChannel

CHANNEL = SendChannel("veh-a", "boot", "schema", "key")
DESCRIBED = Outgoing(CHANNEL, 0, 5, b"description")


def said(sequence: int, boot_id: str = "boot") -> EventIdentity:
    return EventIdentity("veh-a", boot_id, sequence)


def oldest(sequence: int) -> Outgoing:
    return Outgoing(CHANNEL, sequence, 5, b"")


def test_each_missing_number_is_told_to_be_gone() -> None:
    sent = bridge(said(3), oldest(7), {}, key="unknown")
    assert [(one.sequence, one.channel.schema_name, one.channel.key) for one in sent] == [
        (number, DROPPED_SCHEMA, "unknown") for number in (4, 5, 6)
    ]


def test_a_known_description_is_sent_again_instead() -> None:
    assert bridge(said(-1), oldest(2), {"boot": DESCRIBED}, key="unknown")[0] is DESCRIBED


@pytest.mark.parametrize("heard", [None, said(6), said(7), said(99), said(3, "another"), said(-5)])
def test_where_nothing_is_missing_nothing_is_sent(heard: EventIdentity | None) -> None:
    assert bridge(heard, oldest(7), {}, key="unknown") == []


def test_a_long_stretch_goes_part_by_part() -> None:
    assert len(bridge(said(-1), oldest(10**9), {}, key="unknown")) == BRIDGED_TOGETHER
