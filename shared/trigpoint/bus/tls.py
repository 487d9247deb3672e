"""Who a process is on the bus: its certificate, its key, and the authority it trusts."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path

from trigpoint.errors import InputError

OTHERS = 0o007  # permission bits of everyone but the owner and the group
LOOPBACK_NAME = "localhost"
OVER_IP = ("tcp", "tls", "udp", "quic", "ws")  # protocols of endpoints that are a host and a port
PORT_LAST = 65_535


@dataclass(frozen=True, slots=True, kw_only=True)
class TlsFiles:
    """PEM files: the authority that both ends are signed by, this process's certificate, and the key to it."""

    authority_file: Path
    certificate_file: Path
    key_file: Path

    def checked(self) -> "TlsFiles":
        """The files themselves. Raises InputError for one that is not there, and for a key that others may read."""
        for path in (self.authority_file, self.certificate_file, self.key_file):
            if not path.is_file():
                raise InputError(f"{path}: no such file")
        mode = self.key_file.stat().st_mode & 0o777
        if mode & OTHERS:
            raise InputError(f"{self.key_file} has mode {mode:04o}: a key is for its owner, 0600 (or a group, 0640)")
        return self


def tls_values(files: TlsFiles) -> Iterator[tuple[str, object]]:
    """The names and values by which Zenoh is told of them: both ends show a certificate, and a link ends with it."""
    key, certificate = str(files.key_file.absolute()), str(files.certificate_file.absolute())
    values: dict[str, object] = {
        "root_ca_certificate": str(files.authority_file.absolute()),
        "enable_mtls": True,
        "listen_private_key": key,
        "listen_certificate": certificate,
        "connect_private_key": key,
        "connect_certificate": certificate,
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
    }
    yield "transport/link/tls", values
    yield "transport/link/protocols", ["tls"]
    yield "transport/shared_memory/enabled", False  # large messages go by the protected link, too


def checked_endpoints(listen: Sequence[str], connect: Sequence[str], files: TlsFiles | None) -> None:
    """Nothing, if the endpoints go with the files.

    Raises InputError for what is no endpoint, for `tls/` without files, for anything else with them, and for an
    unprotected endpoint that listens beyond this machine.
    """
    for endpoint in (*listen, *connect):
        _require_form(endpoint)
        protocol = endpoint.partition("/")[0]
        if protocol == "tls" and files is None:
            raise InputError(f"endpoint {endpoint!r}: needs authority_file, certificate_file and key_file under tls")
        if protocol != "tls" and files is not None:
            raise InputError(f"endpoint {endpoint!r}: with files under tls it begins with 'tls/'")
    if files is None:
        for endpoint in listen:
            if not is_local(endpoint):
                raise InputError(f"endpoint {endpoint!r}: beyond this machine only 'tls/' may listen")


def _require_form(endpoint: str) -> None:
    protocol, _, rest = endpoint.partition("/")
    host, port = _host_and_port(rest)
    is_address = bool(host) and port.isdecimal() and int(port) <= PORT_LAST
    if not protocol or not rest or (protocol in OVER_IP and not is_address):
        raise InputError(f"endpoint {endpoint!r}: PROTOCOL/HOST:PORT is needed, as in tcp/127.0.0.1:7447")


def _host_and_port(rest: str) -> tuple[str, str]:
    host, _, port = rest.partition("#")[0].partition("?")[0].rpartition(":")
    return host, port


def is_local(endpoint: str) -> bool:
    """Whether an endpoint is reached from this machine only: a loopback address, or no address of a network."""
    protocol, _, rest = endpoint.partition("/")
    if protocol.startswith("unix"):
        return True
    host = _host_and_port(rest)[0].strip("[]")
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == LOOPBACK_NAME
