"""An authority, the certificates of a small fleet, its router, and anyone's session on it."""

import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from command_runs.processes import Fleet, Process, comes_true, free_ports, trigpoint_process
from trigpoint.bus.ports import BusMessage
from trigpoint.bus.register import REGISTER_NAME, Role
from trigpoint.bus.tls import TlsFiles
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings
from trigpoint.configuration.authority import CERTIFICATE_NAME, ISSUED_NAME, PUBLIC_NAME, Authority, make_authority
from trigpoint.events.envelope import EventIdentity

DAYS = 30
DAY_S = 86_400
NAMES = {
    "router": Role.ROUTER,
    "veh-a": Role.VEHICLE,
    "veh-b": Role.VEHICLE,
    "ingest": Role.INGEST,
    "services": Role.SERVICE,
    "viewer": Role.CLIENT,
}


def authority_of(folder: Path) -> Authority:
    """A new authority with the names of a small fleet."""
    authority = make_authority(folder / "authority", name="tests", now_s=int(time.time()), passphrase=None)
    for name, role in NAMES.items():
        issue(authority, name, role)
    return authority


def issue(authority: Authority, name: str, role: Role, *, ago_days: int = 0, days: int = DAYS) -> None:
    """A certificate of some days, from some days ago."""
    now_s = int(time.time()) - ago_days * DAY_S
    authority.issue(name, role, now_s=now_s, days=days, alternatives=("127.0.0.1",), passphrase=None)


def files_of(folder: Path, name: str, *, trusting: Path | None = None) -> TlsFiles:
    """The files of a name of the authority in a folder, with another authority to trust if one is given."""
    return TlsFiles(
        authority_file=(trusting or folder) / "authority" / PUBLIC_NAME / CERTIFICATE_NAME,
        certificate_file=folder / "authority" / ISSUED_NAME / f"{name}.pem",
        key_file=folder / "authority" / ISSUED_NAME / f"{name}.key",
    )


def tls_lines(files: TlsFiles) -> str:
    """The files as lines of a configuration."""
    return (
        f'authority_file = "{files.authority_file}"\n'
        f'certificate_file = "{files.certificate_file}"\n'
        f'key_file = "{files.key_file}"\n'
    )


@dataclass(frozen=True, slots=True)
class SecuredFleet:
    """A fleet with its authority and its running router."""

    fleet: Fleet
    authority: Authority
    router: Process

    @property
    def folder(self) -> Path:
        """Where all of it is."""
        return self.fleet.folder

    def settings(self, name: str) -> ZenohSettings:
        """How a name of the fleet comes to the router, which may be busy opening its session anew."""
        return self.settings_with(files_of(self.folder, name), timeout_s=30.0)

    def settings_with(self, files: TlsFiles, *, timeout_s: float = 0.5) -> ZenohSettings:
        """How whoever has these files comes to the router; an intruder does not try for long."""
        return ZenohSettings(mode="client", connect=(self.fleet.endpoint,), connect_timeout_s=timeout_s, tls=files)

    def changes(self) -> int:
        """How often the router's rules changed."""
        return sum(row["message"] == "rules changed" for row in self.router.logged())

    def issue(self, name: str, role: Role, *, ago_days: int = 0, days: int = DAYS) -> None:
        """A certificate for a new name, and the router works by the rules for it."""
        before = self.changes()
        issue(self.authority, name, role, ago_days=ago_days, days=days)
        assert comes_true(lambda: self.changes() > before)

    def issue_unregistered(self, name: str) -> None:
        """A good certificate for a name that the register does not have."""
        register = self.authority.register_file.read_bytes()
        self.issue(name, Role.CLIENT)
        before = self.changes()
        self.authority.register_file.write_bytes(register)
        assert comes_true(lambda: self.changes() > before)

    def revoke(self, name: str) -> None:
        """The name revoked, and the router works by the rules without it."""
        before = self.changes()
        self.authority.revoke(name)
        assert comes_true(lambda: self.changes() > before)

    def session(self, name: str) -> ZenohBus:
        """A name's session on the bus."""
        return ZenohBus(self.settings(name))

    def metric(self, process: str, name: str, label: str = "") -> float:
        """The sum of a process's metric over the labels that hold a text."""
        body = self.fleet.page(process, "/metrics")[1]
        found = re.findall(rf"^{name}({{.*}})? (\S+)$", body, flags=re.MULTILINE)
        return sum(float(value) for labels, value in found if label in labels)

    def refused(self) -> float:
        """How many refusals the router has counted."""
        return self.metric("router", "trigpoint_refused_access_total")

    def refusals(self) -> list[tuple[str, str, str]]:
        """Who was refused, what, and on which key, as the router logged it."""
        rows = [row for row in self.router.logged() if row["message"] == "refused"]
        return [(row["who"], row["what"], row["key"]) for row in rows]


def secured_configuration(folder: Path, *, more: str = "") -> Fleet:
    """The configuration of a secured fleet, its services under the name `services`; `more` is added."""
    processes = ("up", "router", "ingest", "filtering", "perception", "optimisation", "landmarks")
    *numbers, last = free_ports(len(processes) + 1)
    fleet = Fleet(folder=folder, ports=dict(zip(processes, numbers, strict=True)), endpoint=f"tls/127.0.0.1:{last}")
    ports = "".join(f"{name}_port = {port}\n" for name, port in fleet.ports.items())
    register = folder / "authority" / PUBLIC_NAME / REGISTER_NAME
    fleet.config.write_text(
        f'[fleet]\ndata = "{fleet.data}"\n'
        f'[bus]\nmode = "client"\nconnect = ["{fleet.endpoint}"]\nconnect_timeout_s = 30.0\n'
        f"[bus.tls]\n{tls_lines(files_of(folder, 'services'))}"
        f'[router]\nlisten = ["{fleet.endpoint}"]\nregister_file = "{register}"\n'
        f"[router.tls]\n{tls_lines(files_of(folder, 'router'))}[http]\n{ports}{more}",
        encoding="utf-8",
    )
    return fleet


@contextmanager
def secured_fleet(folder: Path, *, more: str = "") -> Iterator[SecuredFleet]:
    """A fleet with its router running; `more` are further lines of the configuration."""
    folder.mkdir(parents=True, exist_ok=True)
    authority = authority_of(folder)
    fleet = secured_configuration(folder, more=more)
    with trigpoint_process(folder, "router", "--config", fleet.config) as router:
        fleet.wait_ready("router")
        yield SecuredFleet(fleet, authority, router)


def message(key: str, *, source: str = "veh-a", sequence: int = 0, payload: bytes = b"fix") -> BusMessage:
    """Any message on a key."""
    return BusMessage(
        key=key,
        schema_name="trigpoint.v1.GnssFixReceived",
        payload=payload,
        identity=EventIdentity(source, "boot-1", sequence),
        stamp_ns=1_700_000_000_000_000_000,
    )
