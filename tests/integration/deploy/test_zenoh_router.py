"""The router configuration that ships: it opens, stays on loopback, and carries messages between clients."""

import json
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh

from trigpoint.bus.ports import BusMessage
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings
from trigpoint.events.envelope import EventIdentity

CONFIGURATION = Path(__file__).parents[3] / "deploy" / "zenoh-router.json5"
SOON_S = 5.0  # loopback takes under a millisecond; the rest is a slow machine's share


@pytest.fixture
def endpoint() -> Iterator[str]:
    """A router of the shipped configuration, on a free port in place of its own."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        free = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    configuration = zenoh.Config.from_file(str(CONFIGURATION))
    configuration.insert_json5("listen/endpoints", json.dumps([free]))
    with zenoh.open(configuration):
        yield free


def test_the_router_listens_on_loopback_only() -> None:
    listened = json.loads(zenoh.Config.from_file(str(CONFIGURATION)).get_json("listen/endpoints"))
    assert listened == ["tcp/127.0.0.1:7447"]


def test_a_message_passes_between_two_clients_of_the_router(endpoint: str) -> None:
    client = ZenohSettings(mode="client", connect=(endpoint,))
    message = BusMessage(
        key="trigpoint/v1/veh/veh-a/obs/gnss",
        schema_name="test",
        payload=b"fix",
        identity=EventIdentity("veh-a", "boot", 0),
        stamp_ns=1,
    )
    with ZenohBus(client) as vehicle, ZenohBus(client) as service:
        subscription = service.subscribe("trigpoint/v1/veh/*/obs/*")
        assert vehicle.await_listener(message.key, SOON_S)
        vehicle.publish(message)
        assert subscription.receive(SOON_S) == message
