"""A vehicle with a good certificate and bad intentions, against real router and ingest processes."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from command_runs.processes import Process, comes_true, trigpoint_process
from secured_fleet.fleet import SecuredFleet, message, secured_fleet
from trigpoint.bus.attachment import encode_attachment
from trigpoint.bus.ports import BusMessage
from trigpoint.errors import InputError
from trigpoint.events.codec import encode
from trigpoint.events.envelope import EventIdentity
from trigpoint.events.observed import EventRefused, ImuMeasured, VehicleDescribed
from trigpoint.events.uplink import uplink_key
from trigpoint.logs.mcap_log import McapLog
from trigpoint_vehicle.publisher import VehiclePublisher

LIMITS = "[ingest]\nmessage_limit_bytes = 100000\nvehicle_rate_hz = 200.0\nvehicle_burst = 400\n"
STAMP_NS = 1_700_000_000_000_000_000
SOON_S = 10.0


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[SecuredFleet]:
    with secured_fleet(tmp_path / "fleet", more=LIMITS) as fleet:
        yield fleet


@pytest.fixture
def ingest(fleet: SecuredFleet) -> Iterator[Process]:
    with trigpoint_process(fleet.folder, "serve", "ingest", "--config", fleet.fleet.config) as process:
        fleet.fleet.wait_ready("ingest")
        yield process


def imu(vehicle: str, sequence: int, *, key: str = "") -> BusMessage:
    """One IMU reading, valid in itself."""
    schema_name, payload = encode(ImuMeasured(yaw_rate_radps=0.1, acceleration_x_mps2=0.0, acceleration_y_mps2=0.0))
    sent = message(key or uplink_key(vehicle, ImuMeasured), source=vehicle, sequence=sequence, payload=payload)
    return replace(sent, schema_name=schema_name, stamp_ns=STAMP_NS + sequence)


def send(fleet: SecuredFleet, *messages: BusMessage) -> None:
    """Messages of veh-a's own session, on whatever keys."""
    with fleet.session("veh-a") as bus:
        assert bus.await_listener(uplink_key("veh-a", ImuMeasured), SOON_S)
        for one in messages:
            bus.publish(one)
        assert bus.await_listener(uplink_key("veh-a", ImuMeasured), SOON_S)


def other_vehicle_gets_through(fleet: SecuredFleet) -> bool:
    """Whether veh-b's events are taken and acknowledged while all this goes on."""
    spool = fleet.folder / "spool"
    with VehiclePublisher("veh-b", spool, fleet.settings("veh-b")) as publisher:
        publisher.describe(VehicleDescribed(vehicle="veh-b", wheelbase_m=2.8), stamp_ns=STAMP_NS)
        for index in range(20):
            event = ImuMeasured(yaw_rate_radps=0.1, acceleration_x_mps2=0.0, acceleration_y_mps2=0.0)
            publisher.send(event, stamp_ns=STAMP_NS + 1 + index)
        return publisher.flush(SOON_S)


def rejected(fleet: SecuredFleet, reason: str) -> float:
    return fleet.metric("ingest", "trigpoint_rejected_total", f'reason="{reason}"')


def kept_aside(fleet: SecuredFleet) -> list[str]:
    """The reasons of what was refused, as the log has them."""
    with closing(McapLog(fleet.fleet.data / "log")) as log:
        events = [row.envelope.event for row in log.read("refused")]
    return [event.reason for event in events if isinstance(event, EventRefused)]


def stored(fleet: SecuredFleet, vehicle: str) -> list[EventIdentity]:
    with closing(McapLog(fleet.fleet.data / "log")) as log:
        return [row.envelope.identity for row in log.read(f"veh-{vehicle}")]


def test_a_vehicle_that_calls_itself_another_on_its_own_key_is_refused_and_the_other_is_not_harmed(
    fleet: SecuredFleet, ingest: Process
) -> None:
    key = uplink_key("veh-a", ImuMeasured)
    send(fleet, *(imu("veh-b", sequence, key=key) for sequence in range(5)))
    assert comes_true(lambda: rejected(fleet, "wrong sender") == 5.0)
    assert fleet.metric("ingest", "trigpoint_refused_access_total") == 5.0
    assert other_vehicle_gets_through(fleet)
    assert ingest.stop() == 0
    assert kept_aside(fleet) == ["wrong sender"] * 5
    assert len(stored(fleet, "veh-b")) == 21


def test_a_message_over_the_limit_is_refused_and_the_next_vehicle_is_heard(
    fleet: SecuredFleet, ingest: Process
) -> None:
    big = replace(imu("veh-a", 0), payload=b"x" * 100_001)
    send(fleet, big)
    assert comes_true(lambda: rejected(fleet, "too large") == 1.0)
    assert other_vehicle_gets_through(fleet)
    assert ingest.stop() == 0
    assert stored(fleet, "veh-a") == []


@pytest.mark.slow
def test_a_message_over_the_buss_own_limit_goes_no_further_than_the_router(
    fleet: SecuredFleet, ingest: Process
) -> None:
    send(fleet, replace(imu("veh-a", 0), payload=b"x" * (65 * 1024 * 1024)))
    assert other_vehicle_gets_through(fleet)
    assert fleet.metric("ingest", "trigpoint_rejected_total") == 0.0
    assert (fleet.router.stop(), ingest.stop()) == (0, 0)


def test_a_flood_is_throttled_and_counted_and_others_are_heard(fleet: SecuredFleet, ingest: Process) -> None:
    send(fleet, *(imu("veh-a", sequence) for sequence in range(3000)))
    assert comes_true(lambda: fleet.metric("ingest", "trigpoint_throttled_total", "veh-a") > 2000)
    assert other_vehicle_gets_through(fleet)
    assert "too many messages" in ingest.err
    assert ingest.err.count("too many messages") == 1  # told once, however many


def test_bytes_that_are_no_messages_are_refused_kept_and_harm_nobody(fleet: SecuredFleet, ingest: Process) -> None:
    good = imu("veh-a", 0)
    junk = [
        replace(good, payload=b"\xff" * 500),
        replace(good, schema_name="no.such.Schema", identity=EventIdentity("veh-a", "boot-1", 1)),
        replace(good, schema_name="", identity=EventIdentity("veh-a", "boot-1", 2)),
        replace(good, identity=EventIdentity("veh-a", "b" * 60_000, 3)),
        replace(good, identity=EventIdentity("veh-a", "boot-1", 2**62)),
        replace(good, identity=EventIdentity("", "", -5)),
    ]
    send(fleet, *junk)
    assert comes_true(lambda: fleet.metric("ingest", "trigpoint_rejected_total") >= 2.0)
    assert other_vehicle_gets_through(fleet)
    assert ingest.stop() == 0
    assert len(kept_aside(fleet)) >= 2
    assert stored(fleet, "veh-a") == []


def test_an_attachment_holds_no_number_that_does_not_fit() -> None:
    with pytest.raises(InputError):
        encode_attachment(EventIdentity("veh-a", "boot-1", 2**63), stamp_ns=0, schema_version=1)
