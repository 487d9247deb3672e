"""An authority, the certificates of a small fleet, its router, and anyone's session on it."""

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from secured_fleet.processes import RunningProcess, free_port, running
from trigpoint.bus.ports import BusMessage
from trigpoint.bus.register import Role
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
    """A fleet's folder, authority, router process and configuration file."""

    folder: Path
    authority: Authority
    router: RunningProcess
    endpoint: str
    configuration: Path

    def settings(self, name: str) -> ZenohSettings:
        """How a name of the fleet comes to the router."""
        return self.settings_with(files_of(self.folder, name))

    def settings_with(self, files: TlsFiles) -> ZenohSettings:
        """How whoever has these files comes to the router; it tries for half a second."""
        return ZenohSettings(mode="client", connect=(self.endpoint,), connect_timeout_s=0.5, tls=files)

    def session(self, name: str) -> ZenohBus:
        """A name's session on the bus."""
        return ZenohBus(self.settings(name))

    def refused(self) -> float:
        """How many refusals the router has counted."""
        return self.router.metric("trigpoint_refused_access_total")

    def refusals(self) -> list[tuple[str, str, str]]:
        """Who was refused, what, and on which key, as the router logged it."""
        rows = [row for row in self.router.rows() if row["message"] == "refused"]
        return [(row["who"], row["what"], row["key"]) for row in rows]


def configuration_of(folder: Path, *, endpoint: str, http: dict[str, int], more: str = "") -> Path:
    """The configuration of a secured fleet, its services under the name `services`."""
    path = folder / "trigpoint.toml"
    ports = "".join(f"{name}_port = {port}\n" for name, port in http.items())
    path.write_text(
        f'[fleet]\ndata = "{folder / "data"}"\n'
        f'[bus]\nmode = "client"\nconnect = ["{endpoint}"]\n[bus.tls]\n{tls_lines(files_of(folder, "services"))}'
        f'[router]\nlisten = ["{endpoint}"]\nregister_file = "{folder / "authority" / PUBLIC_NAME / "register.json"}"\n'
        f"[router.tls]\n{tls_lines(files_of(folder, 'router'))}[http]\n{ports}{more}",
        encoding="utf-8",
    )
    return path


@contextmanager
def secured_fleet(folder: Path, *, more: str = "") -> Iterator[SecuredFleet]:
    """A fleet with its router running; `more` are further lines of the configuration."""
    folder.mkdir(parents=True, exist_ok=True)
    authority = authority_of(folder)
    endpoint, http = f"tls/127.0.0.1:{free_port()}", {"router": free_port(), "ingest": free_port()}
    configuration = configuration_of(folder, endpoint=endpoint, http=http, more=more)
    with ExitStack() as stack:
        router = stack.enter_context(running(folder, "router", "--config", configuration, port=http["router"]))
        yield SecuredFleet(folder, authority, router, endpoint, configuration)


def message(key: str, *, source: str = "veh-a", sequence: int = 0, payload: bytes = b"fix") -> BusMessage:
    """Any message on a key."""
    return BusMessage(
        key=key,
        schema_name="trigpoint.v1.GnssFixReceived",
        payload=payload,
        identity=EventIdentity(source, "boot-1", sequence),
        stamp_ns=1_700_000_000_000_000_000,
    )
