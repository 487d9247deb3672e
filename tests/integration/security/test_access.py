"""What a real router refuses over real TLS sessions, and how it tells of it."""

import socket
import ssl
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from command_runs.processes import CLEAN, comes_true
from secured_fleet.fleet import DAY_S, SecuredFleet, authority_of, files_of, message, secured_fleet
from trigpoint.bus.ports import Subscription
from trigpoint.bus.register import Role
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings
from trigpoint.errors import InputError, ServiceError

SOON_S = 10.0  # loopback and a handshake take milliseconds; the rest is a slow machine's share
UP_A, UP_B = "trigpoint/v1/veh/veh-a/up/gnss", "trigpoint/v1/veh/veh-b/up/gnss"


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SecuredFleet]:
    with secured_fleet(tmp_path_factory.mktemp("fleet")) as fleet:
        yield fleet


def keys_up_to(subscription: Subscription, last: str) -> list[str]:
    """The keys received, up to one that certainly comes."""
    keys: list[str] = []
    while not keys or keys[-1] != last:
        received = subscription.receive(SOON_S)
        assert received is not None, keys
        keys.append(received.key)
    return keys


def sent_as(fleet: SecuredFleet, name: str, keys: list[str]) -> list[str]:
    """What ingest hears of messages that a vehicle publishes on some keys, the last of them its own."""
    with fleet.session("ingest") as ingest, fleet.session(name) as vehicle:
        heard = ingest.subscribe("trigpoint/v1/veh/*/up/*")
        assert vehicle.await_listener(keys[-1], SOON_S)
        for sequence, key in enumerate(keys):
            vehicle.publish(message(key, sequence=sequence))
        return keys_up_to(heard, keys[-1])


def told_of(fleet: SecuredFleet, who: str, key: str) -> bool:
    return any(row[0] == who and row[2] == key for row in fleet.refusals())


def test_a_vehicle_that_publishes_as_another_is_not_heard_and_named_with_the_key(fleet: SecuredFleet) -> None:
    before = fleet.refused()
    assert sent_as(fleet, "veh-a", [UP_B, UP_B, UP_A]) == [UP_A]
    assert comes_true(lambda: fleet.refused() >= before + 2)
    assert comes_true(lambda: told_of(fleet, "veh-a", UP_B))


def test_a_vehicle_publishes_no_acknowledgement_and_no_event(fleet: SecuredFleet) -> None:
    forged = ["trigpoint/v1/ack/veh-a", "trigpoint/v1/veh/veh-a/obs/gnss", "trigpoint/v1/map/main/anchor"]
    with fleet.session("services") as services, fleet.session("veh-a") as vehicle:
        heard = services.subscribe("trigpoint/v1/veh/*/obs/*")
        mapped = services.subscribe("trigpoint/v1/map/**")
        uplink = services.subscribe("trigpoint/v1/veh/*/up/*")
        assert vehicle.await_listener(UP_A, SOON_S)
        for key in (*forged, UP_A):
            vehicle.publish(message(key))
        assert uplink.receive(SOON_S) is not None
        assert (heard.receive(0.0), mapped.receive(0.0)) == (None, None)
    assert comes_true(lambda: all(told_of(fleet, "veh-a", key) for key in forged))


def test_a_vehicle_hears_its_own_acknowledgement_and_not_anothers(fleet: SecuredFleet) -> None:
    own, foreign = "trigpoint/v1/ack/veh-a", "trigpoint/v1/ack/veh-b"
    with fleet.session("ingest") as ingest, fleet.session("veh-a") as vehicle:
        heard, overheard = vehicle.subscribe(own), vehicle.subscribe(foreign)
        assert ingest.await_listener(own, SOON_S)
        ingest.publish(message(foreign))
        ingest.publish(message(own))
        assert keys_up_to(heard, own) == [own]
        assert overheard.receive(0.0) is None
    assert comes_true(lambda: told_of(fleet, "veh-a", foreign))


def test_a_client_reads_maps_and_nothing_of_vehicles(fleet: SecuredFleet) -> None:
    version = "trigpoint/v1/map/main/version"
    with fleet.session("services") as services, fleet.session("viewer") as viewer:
        heard, overheard = viewer.subscribe("trigpoint/v1/map/**"), viewer.subscribe("trigpoint/v1/veh/**")
        assert services.await_listener(version, SOON_S)
        services.publish(message("trigpoint/v1/veh/veh-a/est/pose"))
        services.publish(message(version))
        assert keys_up_to(heard, version) == [version]
        assert overheard.receive(0.0) is None
    assert comes_true(lambda: told_of(fleet, "viewer", "trigpoint/v1/veh/**"))


def test_a_certificate_of_another_authority_gets_no_session(fleet: SecuredFleet, tmp_path: Path) -> None:
    before = fleet.refused()
    authority_of(tmp_path)
    with pytest.raises(ServiceError):
        ZenohBus(fleet.settings_with(files_of(tmp_path, "veh-a", trusting=fleet.folder)))
    assert comes_true(lambda: fleet.refused() > before)
    assert comes_true(lambda: "invalid peer certificate" in fleet.router.err)


def test_a_certificate_past_its_end_gets_no_session(fleet: SecuredFleet) -> None:
    fleet.issue("veh-old", Role.VEHICLE, ago_days=10, days=5)
    before = fleet.refused()
    with pytest.raises(ServiceError):
        ZenohBus(fleet.settings_with(files_of(fleet.folder, "veh-old")))
    assert comes_true(lambda: fleet.refused() > before)
    assert comes_true(lambda: "certificate expired" in fleet.router.err)


def test_a_session_ends_with_its_certificate(fleet: SecuredFleet) -> None:
    lifetime_s = 10  # most of it for a slow machine to connect in
    before = fleet.changes()
    began_s = int(time.time()) + lifetime_s - DAY_S
    fleet.authority.issue("veh-brief", Role.VEHICLE, now_s=began_s, days=1, alternatives=(), passphrase=None)
    assert comes_true(lambda: fleet.changes() > before)
    key = "trigpoint/v1/veh/veh-brief/up/gnss"
    with fleet.session("ingest") as ingest, fleet.session("veh-brief") as vehicle:
        heard = ingest.subscribe(key)
        assert comes_true(lambda: _passes(vehicle, heard, key), within_s=lifetime_s)
        assert comes_true(lambda: not _passes(vehicle, heard, key))


def test_whoever_speaks_no_tls_gets_no_session(fleet: SecuredFleet) -> None:
    plain = fleet.fleet.endpoint.replace("tls/", "tcp/")
    with pytest.raises(ServiceError):
        ZenohBus(ZenohSettings(mode="client", connect=(plain,), connect_timeout_s=0.5))


def test_whoever_shows_no_certificate_gets_no_session(fleet: SecuredFleet) -> None:
    before = fleet.refused()
    context = ssl.create_default_context(cafile=str(files_of(fleet.folder, "veh-a").authority_file))
    host, _, port = fleet.fleet.endpoint.removeprefix("tls/").partition(":")
    with (
        socket.create_connection((host, int(port)), timeout=SOON_S) as plain,
        pytest.raises(ssl.SSLError),
        context.wrap_socket(plain, server_hostname=host) as protected,
    ):
        protected.recv(1)  # with TLS 1.3 the refusal comes after the handshake
    assert comes_true(lambda: fleet.refused() > before)
    assert comes_true(lambda: "peer sent no certificates" in fleet.router.err)


def test_a_router_of_another_authority_is_not_trusted(fleet: SecuredFleet, tmp_path: Path) -> None:
    authority_of(tmp_path)
    with pytest.raises(ServiceError):
        ZenohBus(fleet.settings_with(files_of(fleet.folder, "veh-a", trusting=tmp_path)))


def test_a_name_that_is_not_in_the_register_reads_nothing_and_is_named(fleet: SecuredFleet, tmp_path: Path) -> None:
    fleet.issue_unregistered("stranger")
    with (
        fleet.session("services") as services,
        fleet.session("stranger") as stranger,
        fleet.session("viewer") as viewer,
    ):
        overheard, heard = stranger.subscribe("trigpoint/v1/map/**"), viewer.subscribe("trigpoint/v1/map/**")
        assert services.await_listener("trigpoint/v1/map/main/version", SOON_S)
        services.publish(message("trigpoint/v1/map/main/version"))
        assert heard.receive(SOON_S) is not None
        assert overheard.receive(0.0) is None
    assert comes_true(lambda: any(row[0] == "stranger" for row in fleet.refusals()))


def test_a_revoked_name_is_heard_no_more_and_its_next_certificate_is_another(fleet: SecuredFleet) -> None:
    own = "trigpoint/v1/veh/veh-c/up/gnss"
    fleet.issue("veh-c", Role.VEHICLE)
    assert _is_heard(fleet, "veh-c", own)
    with fleet.session("ingest") as ingest, fleet.session("veh-a") as other:
        heard = ingest.subscribe("trigpoint/v1/veh/*/up/*")
        fleet.revoke("veh-c")
        assert not _is_heard(fleet, "veh-c", own)
        assert comes_true(lambda: _passes(other, heard))  # a session from before comes back by itself
    fleet.issue("veh-c", Role.VEHICLE)
    assert _is_heard(fleet, "veh-c.2", own)
    assert not _is_heard(fleet, "veh-c", own)


def _passes(vehicle: ZenohBus, heard: Subscription, key: str = UP_A) -> bool:
    vehicle.await_listener(key, 0.5)
    vehicle.publish(message(key))
    return heard.receive(0.5) is not None


def _is_heard(fleet: SecuredFleet, name: str, key: str) -> bool:
    """Whether ingest hears what the certificate's owner publishes, in sessions of their own."""
    with fleet.session("ingest") as ingest, fleet.session(name) as vehicle:
        heard = ingest.subscribe(key)
        vehicle.await_listener(key, 3.0)
        vehicle.publish(message(key))
        return heard.receive(3.0) is not None


def test_a_damaged_register_changes_no_rule_and_is_told(fleet: SecuredFleet) -> None:
    register = fleet.authority.register_file.read_bytes()
    fleet.authority.register_file.write_bytes(register[:-20])
    assert comes_true(lambda: "the rules stay as they were" in fleet.router.err)
    assert sent_as(fleet, "veh-a", [UP_B, UP_A]) == [UP_A]
    fleet.authority.register_file.write_bytes(register)


def test_a_key_that_others_may_read_is_not_used(fleet: SecuredFleet, tmp_path: Path) -> None:
    authority_of(tmp_path)
    files = files_of(tmp_path, "veh-a")
    files.key_file.chmod(0o644)
    with pytest.raises(InputError, match="mode 0644"):
        ZenohBus(fleet.settings_with(files))


FORGED_HEAD = "2026-11-22T06:13:16.820114Z TRACE  rx-0 ThreadId(77) zenoh::net::routing::interceptor"
FORGED = (
    f"x\n{FORGED_HEAD}::access_control: abcdef on Interface(lo)+CertCommonName(veh-b)+x is unauthorized to Put "
    f"(ingress) on stolen\n{FORGED_HEAD}: Msg intercepted!\nz"
)


def test_a_key_with_forged_log_lines_in_it_blames_nobody_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(CLEAN, "NO_COLOR", "1")
    with secured_fleet(tmp_path / "fleet") as fleet, fleet.session("veh-a") as vehicle:
        for forged in (FORGED, FORGED.replace("2026-", "\x1b[2m2026-")):
            vehicle.publish(message(f"trigpoint/v1/{forged}"))
        assert comes_true(lambda: fleet.refused() >= 2.0)
        assert {row[0] for row in fleet.refusals()} == {"veh-a"}
