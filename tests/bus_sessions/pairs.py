"""Two sessions of a bus, and messages for them."""

import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from trigpoint.bus.memory_bus import MemoryBus, MemoryExchange
from trigpoint.bus.ports import Bus, BusMessage
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings
from trigpoint.events.envelope import EventIdentity

SOON_S = 5.0  # a loopback message takes under a millisecond; the rest is a slow machine's share
NEVER_S = 0.05  # long enough for a loopback message that should not come
SMALL_INBOX = 10  # messages


def free_endpoint() -> str:
    """A TCP endpoint on loopback that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


@contextmanager
def paired(kind: str) -> Iterator[tuple[Bus, Bus]]:
    """Two sessions of the "memory" or the "zenoh" bus: one to publish, one to listen, with room for SMALL_INBOX."""
    with ExitStack() as stack:
        if kind == "memory":
            exchange = MemoryExchange()
            buses: list[Bus] = [MemoryBus(exchange, capacity=SMALL_INBOX) for _ in range(2)]
        else:
            endpoint = free_endpoint()
            listening = ZenohBus(ZenohSettings(listen=(endpoint,), inbox_capacity=SMALL_INBOX))
            buses = [ZenohBus(ZenohSettings(connect=(endpoint,))), listening]
        for bus in buses:
            stack.enter_context(bus)
        yield buses[0], buses[1]


def message(key: str, sequence: int = 0) -> BusMessage:
    """A message with every field set."""
    return BusMessage(
        key=key,
        schema_name="trigpoint.v1.GnssFixReceived",
        payload=bytes([sequence % 256]) * 100,
        identity=EventIdentity("veh-å", "boot-1", sequence),
        stamp_ns=1_700_000_000_123_456_789,
        schema_version=3,
    )


def until_heard(bus: Bus, key: str) -> None:
    """Discovery of a subscription takes a moment; what is published before it is lost by design."""
    assert bus.await_listener(key, SOON_S), f"nobody listens to {key}"
