"""Intruders against a real router and a real ingest, over TLS on loopback: what got through, or went unnoticed.

Zenoh tells a refused publisher nothing, so that each try is looked for on the other side: nobody heard it, the router
(or ingest) counted it, and one of them logged who it was.
"""

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from command_runs.processes import comes_true, fleet_in, trigpoint_process
from figures.figure import Figure, Measurement, at_least, at_most
from figures.workbench import CommandFailed, Workbench
from secured_fleet.fleet import SecuredFleet, authority_of, files_of, message, secured_fleet
from trigpoint.bus.ports import BusMessage
from trigpoint.bus.register import Role
from trigpoint.bus.tls import TlsFiles
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings
from trigpoint.errors import ServiceError

MESSAGES, SESSIONS = 1000, 20
OWN, FOREIGN, VERSION = (f"trigpoint/v1/{key}" for key in ("veh/veh-a/up/imu", "veh/veh-b/up/imu", "map/main/version"))
SOON_S = 20.0
ROUTED_COUNT, ROUTED_BYTES, LEAST_S = 20_000, 256, 0.2

Scenario = Callable[[SecuredFleet], int]


def against(fleet_scenario: Scenario, name: str, *, with_ingest: bool = False) -> Callable[[Workbench], Measurement]:
    """A measure: the scenario run against a new fleet."""

    def measure(bench: Workbench) -> Measurement:
        folder = Path(bench.path(name))
        with secured_fleet(folder) as fleet, ExitStack() as stack:
            command = "trigpoint router --config $WORK/trigpoint.toml"
            if with_ingest:
                stack.enter_context(trigpoint_process(folder, "serve", "ingest", "--config", fleet.fleet.config))
                fleet.fleet.wait_ready("ingest")
                command += " & trigpoint serve ingest --config $WORK/trigpoint.toml"
            return Measurement(value=float(fleet_scenario(fleet)), command=f"{command}  # and the intruder")

    return measure


def unnoticed(fleet: SecuredFleet, *, tries: int, before: float, who: str) -> int:
    """How many of the tries the router did not count; all of them if it did not log who it was."""
    comes_true(lambda: fleet.refused() - before >= tries, within_s=SOON_S)
    logged = comes_true(lambda: any(row[0] == who for row in fleet.refusals()), within_s=SOON_S)
    return max(tries - round(fleet.refused() - before), 0) if logged else tries


def heard_until(bus: ZenohBus, expression: str, act: Callable[[], None], *, last: str) -> list[str]:
    """The keys a subscription hears of what is done, up to one that certainly comes."""
    subscription = bus.subscribe(expression)
    act()
    keys: list[str] = []
    while not keys or keys[-1] != last:
        received = subscription.receive(SOON_S)
        if received is None:
            raise CommandFailed(f"{last} was not heard after {len(keys)} others")
        keys.append(received.key)
    return keys


def as_another(fleet: SecuredFleet) -> int:
    """veh-a publishes on veh-b's key, and once on its own."""
    before = fleet.refused()
    with fleet.session("ingest") as ingest, fleet.session("veh-a") as vehicle:

        def act() -> None:
            vehicle.await_listener(OWN, SOON_S)
            for sequence in range(MESSAGES):
                vehicle.publish(message(FOREIGN, source="veh-b", sequence=sequence))
            vehicle.publish(message(OWN))

        keys = heard_until(ingest, "trigpoint/v1/veh/*/up/*", act, last=OWN)
    return keys.count(FOREIGN) + unnoticed(fleet, tries=MESSAGES, before=before, who="veh-a")


def sessions_of(fleet: SecuredFleet, files: TlsFiles) -> int:
    """How many sessions such files get, and how many tries went unnoticed."""
    before, opened = fleet.refused(), 0
    for _ in range(SESSIONS):
        try:
            ZenohBus(fleet.settings_with(files)).close()
            opened += 1
        except ServiceError:
            continue
    return opened + unnoticed(fleet, tries=SESSIONS, before=before, who="no session")


def unknown_certificate(fleet: SecuredFleet) -> int:
    """The certificate of another authority."""
    elsewhere = fleet.folder / "elsewhere"
    authority_of(elsewhere)
    return sessions_of(fleet, files_of(elsewhere, "veh-a", trusting=fleet.folder))


def expired_certificate(fleet: SecuredFleet) -> int:
    """A certificate of the fleet's own authority that ended five days ago."""
    fleet.issue("veh-old", Role.VEHICLE, ago_days=10, days=5)
    return sessions_of(fleet, files_of(fleet.folder, "veh-old"))


def without_role(fleet: SecuredFleet) -> int:
    """A good certificate that the register does not know reads map versions."""
    fleet.issue_unregistered("stranger")
    before = fleet.refused()
    with (
        fleet.session("services") as services,
        fleet.session("stranger") as stranger,
        fleet.session("viewer") as viewer,
    ):
        overheard = stranger.subscribe("trigpoint/v1/map/**")

        def act() -> None:
            services.await_listener(VERSION, SOON_S)
            for sequence in range(MESSAGES):
                services.publish(message(VERSION, source="optimisation", sequence=sequence))

        heard_until(viewer, "trigpoint/v1/map/**", act, last=VERSION)
        read = int(overheard.receive(1.0) is not None)
    return read + unnoticed(fleet, tries=1, before=before, who="stranger")


def revoked(fleet: SecuredFleet) -> int:
    """A vehicle goes on publishing after it was revoked, in sessions old and new."""
    with fleet.session("ingest") as ingest, fleet.session("veh-a") as revoked_vehicle:
        revoked_vehicle.await_listener(OWN, SOON_S)
        fleet.revoke("veh-a")
        before = fleet.refused()
        with fleet.session("veh-a") as again, fleet.session("veh-b") as other:

            def act() -> None:
                other.await_listener(FOREIGN, SOON_S)
                for sequence in range(MESSAGES):
                    revoked_vehicle.publish(message(OWN, sequence=sequence))
                    again.publish(message(OWN, sequence=sequence))
                other.publish(message(FOREIGN, source="veh-b"))

            keys = heard_until(ingest, "trigpoint/v1/veh/*/up/*", act, last=FOREIGN)
    return keys.count(OWN) + unnoticed(fleet, tries=1, before=before, who="veh-a")


def in_anothers_name(fleet: SecuredFleet) -> int:
    """veh-a publishes on its own key messages that say they are veh-b's: the router cannot know, ingest does."""

    def refused() -> float:
        return fleet.metric("ingest", "trigpoint_refused_access_total")

    with fleet.session("veh-a") as vehicle:
        vehicle.await_listener(OWN, SOON_S)
        for sequence in range(MESSAGES):
            vehicle.publish(message(OWN, source="veh-b", sequence=sequence))
        comes_true(lambda: refused() >= MESSAGES, within_s=SOON_S)
    taken = fleet.metric("ingest", "trigpoint_accepted_total")
    return round(taken) + max(MESSAGES - round(refused()), 0)


def seconds_to_revoke(bench: Workbench) -> Measurement:
    """From `certs revoke` until the router works by the new rules."""
    with secured_fleet(Path(bench.path("revoking"))) as fleet:
        began_s = time.monotonic()
        outcome = bench.run("certs", "revoke", "veh-a", "--authority", str(fleet.folder / "authority"))
        comes_true(lambda: any(row["message"] == "rules changed" for row in fleet.router.logged()), within_s=SOON_S)
        return Measurement(value=time.monotonic() - began_s - outcome.wall_s, command=outcome.command)


def routed_hz(sender: ZenohSettings, receiver: ZenohSettings) -> float:
    """Messages a second from one session through a router to another."""
    payload = b"x" * ROUTED_BYTES
    with ZenohBus(receiver) as listening, ZenohBus(sender) as sending:
        subscription = listening.subscribe("trigpoint/v1/veh/*/up/*")
        sending.await_listener(OWN, SOON_S)
        began_s = time.monotonic()
        for sequence in range(ROUTED_COUNT):
            sending.publish(_small(sequence, payload))
        for _ in range(ROUTED_COUNT):
            if subscription.receive(SOON_S) is None:
                raise CommandFailed("a message was lost between two sessions on loopback")
        return ROUTED_COUNT / max(time.monotonic() - began_s, LEAST_S)


def _small(sequence: int, payload: bytes) -> BusMessage:
    return message(OWN, sequence=sequence, payload=payload)


def routed_share(bench: Workbench) -> Measurement:
    """The rate through a router with certificates, rules and named refusals over that of one without, same run."""
    folder = Path(bench.path("plain"))
    plain = fleet_in(folder)
    command = "trigpoint router --config $WORK/trigpoint.toml"
    with trigpoint_process(folder, "router", "--config", plain.config):
        plain.wait_ready("router")
        client = ZenohSettings(mode="client", connect=(plain.endpoint,), connect_timeout_s=SOON_S)
        plain_hz = max(routed_hz(client, client) for _ in range(3))
    with secured_fleet(Path(bench.path("secured"))) as fleet:
        secured_hz = max(routed_hz(fleet.settings("veh-a"), fleet.settings("ingest")) for _ in range(3))
    return Measurement(value=secured_hz / plain_hz, command=f"{command}  # and two sessions; once without certificates")


def intruder(name: str, scenario: Scenario, *, with_ingest: bool = False) -> Figure:
    """How many of an intruder's tries got through, or were not both counted and logged."""
    return Figure(
        name=f"{name}: tries that got through or went unnoticed",
        unit="",
        target=at_most(0.0),
        measure=against(scenario, scenario.__name__, with_ingest=with_ingest),
    )


FIGURES = (
    intruder(f"vehicle A publishing as B, {MESSAGES} messages", as_another),
    intruder(f"vehicle A in B's name on its own key, {MESSAGES} messages", in_anothers_name, with_ingest=True),
    intruder(f"unknown certificate, {SESSIONS} sessions", unknown_certificate),
    intruder(f"expired certificate, {SESSIONS} sessions", expired_certificate),
    intruder(f"reading without a role, {MESSAGES} messages", without_role),
    intruder(f"revoked certificate, {2 * MESSAGES} messages", revoked),
    Figure(name="revoking a name, until the router refuses it", unit="s", target=None, measure=seconds_to_revoke),
    Figure(
        name=f"{ROUTED_BYTES} B messages through a router with certificates and rules, over one without",
        unit="1",
        target=at_least(0.5),
        measure=routed_share,
    ),
)
