"""Two sites: a router with a certificate of its own joins the other, and each holds its vehicles to the rules."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from command_runs.processes import Process, comes_true, free_ports, trigpoint_process
from secured_fleet.fleet import SecuredFleet, files_of, message, secured_fleet
from trigpoint.bus.register import Role
from trigpoint.bus.zenoh_bus import ZenohBus

UP_A, ACK_A = "trigpoint/v1/veh/veh-a/up/gnss", "trigpoint/v1/ack/veh-a"
SOON_S = 30.0


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[SecuredFleet]:
    with secured_fleet(tmp_path / "fleet") as fleet:
        fleet.issue("router-2", Role.ROUTER)
        yield fleet


@contextmanager
def second_router(fleet: SecuredFleet) -> Iterator[tuple[Process, str]]:
    """A router at another endpoint, connected to the first."""
    port, http_port = free_ports(2)
    endpoint, files = f"tls/127.0.0.1:{port}", files_of(fleet.folder, "router-2")
    flags = {
        "router.listen": f'["{endpoint}"]',
        "router.connect": f'["{fleet.fleet.endpoint}"]',
        "router.tls.certificate_file": files.certificate_file,
        "router.tls.key_file": files.key_file,
        "http.router_port": http_port,
    }
    words = [word for key, value in flags.items() for word in ("--set", f"{key}={value}")]
    with trigpoint_process(fleet.folder, "router", "--config", fleet.fleet.config, *words) as process:
        yield process, endpoint


def session_at(fleet: SecuredFleet, name: str, endpoint: str) -> ZenohBus:
    return ZenohBus(replace(fleet.settings(name), connect=(endpoint,)))


def test_what_is_allowed_passes_two_routers_and_what_is_not_ends_at_the_first(fleet: SecuredFleet) -> None:
    with second_router(fleet) as (router, endpoint), fleet.session("ingest") as ingest:
        heard = ingest.subscribe("trigpoint/v1/veh/*/up/*")
        with session_at(fleet, "veh-a", endpoint) as vehicle, session_at(fleet, "veh-b", endpoint) as other:
            acknowledged = vehicle.subscribe(ACK_A)
            assert vehicle.await_listener(UP_A, SOON_S)
            other.publish(message(UP_A, source="veh-b", sequence=1))
            vehicle.publish(message(UP_A, sequence=2))
            received = heard.receive(SOON_S)
            assert received is not None
            assert received.identity.sequence == 2
            assert ingest.await_listener(ACK_A, SOON_S)
            ingest.publish(message(ACK_A))
            assert acknowledged.receive(SOON_S) is not None
        assert comes_true(lambda: any(row.get("who") == "veh-b" for row in router.logged()))
    assert fleet.refusals() == []
