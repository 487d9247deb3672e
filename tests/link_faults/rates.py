"""How many messages a second a publisher takes, spools, sends and has acknowledged, beside a loop of bare puts."""

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import zenoh

from command_runs.processes import CLEAN, free_ports, wait_until
from link_faults.acknowledger import BARE_KEY
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings, session_config
from trigpoint.events.envelope import EventIdentity
from trigpoint.events.uplink import uplink_key
from trigpoint.logs.vehicle_log import RawMessage
from trigpoint_vehicle.publisher import VehiclePublisher

TESTS = Path(__file__).resolve().parents[1]
VEHICLE = "veh-a"
SOON_S = 120.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Rates:
    """Messages a second: bare puts that nobody keeps; taken by a publisher; and acknowledged to it."""

    bare_hz: float
    taken_hz: float
    publisher_hz: float


@contextmanager
def acknowledger() -> Iterator[str]:
    """The endpoint of a process that acknowledges whatever it hears."""
    endpoint = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    words = [sys.executable, "-m", "link_faults.acknowledger", endpoint]
    process = subprocess.Popen(words, env={**CLEAN, "PYTHONPATH": str(TESTS)})
    try:
        with ZenohBus(ZenohSettings(connect=(endpoint,))) as bus:
            assert bus.await_listener(uplink_key(VEHICLE, None), SOON_S), "no acknowledger"
        yield endpoint
    finally:
        process.kill()
        process.wait()


def rates_of(folder: Path, *, messages: int, size_bytes: int) -> Rates:
    """The rates of one run after the other, to the same receiver."""
    payload = b"x" * size_bytes
    with acknowledger() as endpoint:
        bare_hz = messages / bare_s(endpoint, messages=messages, payload=payload)
        settings = ZenohSettings(connect=(endpoint,))
        with VehiclePublisher(VEHICLE, folder, settings) as publisher:
            began_s = time.perf_counter()
            for number in range(messages):
                identity = EventIdentity(VEHICLE, publisher.boot_id, number)
                publisher.forward(RawMessage("", "measured.Size", payload, identity, number))
            taken_s = time.perf_counter() - began_s
            assert publisher.flush(SOON_S), "not everything was acknowledged"
            publisher_s = time.perf_counter() - began_s
    return Rates(bare_hz=bare_hz, taken_hz=messages / taken_s, publisher_hz=messages / publisher_s)


def bare_s(endpoint: str, *, messages: int, payload: bytes) -> float:
    """How long bare puts take, to somebody who only queues them."""
    with zenoh.open(session_config(ZenohSettings(connect=(endpoint,)))) as session:
        publisher = session.declare_publisher(BARE_KEY, congestion_control=zenoh.CongestionControl.BLOCK)
        wait_until(lambda: cast(zenoh.MatchingStatus, publisher.matching_status).matching, "somebody listens")
        began_s = time.perf_counter()
        for _ in range(messages):
            publisher.put(payload)
        return time.perf_counter() - began_s
