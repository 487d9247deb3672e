"""Which endpoints go with certificates, and which without."""

from pathlib import Path

import pytest

from trigpoint.bus.router import RouterSettings
from trigpoint.bus.tls import TlsFiles, is_local
from trigpoint.bus.zenoh_bus import ZenohSettings
from trigpoint.errors import InputError

FILES = TlsFiles(authority_file=Path("a.pem"), certificate_file=Path("c.pem"), key_file=Path("c.key"))


@pytest.mark.parametrize("endpoint", ["tcp/0.0.0.0:7447", "tcp/[::]:7447", "tcp/192.168.1.2:7447", "tcp/router:7447"])
def test_without_certificates_nothing_listens_beyond_this_machine(endpoint: str) -> None:
    with pytest.raises(InputError, match="beyond this machine"):
        ZenohSettings(listen=(endpoint,))


@pytest.mark.parametrize(
    "endpoint", ["tcp/127.0.0.1:7447", "tcp/[::1]:7447", "tcp/localhost:0", "unixsock-stream//run/trigpoint.sock"]
)
def test_what_is_reached_from_this_machine_only_may_listen(endpoint: str) -> None:
    assert is_local(endpoint)
    assert ZenohSettings(listen=(endpoint,)).listen == (endpoint,)


@pytest.mark.parametrize("endpoint", ["rubbish", "tcp", "tcp/", "tcp/host", "tcp/host:", "tcp/:7447", "tcp/host:65536"])
def test_what_is_no_endpoint_is_refused(endpoint: str) -> None:
    with pytest.raises(InputError, match="PROTOCOL/HOST:PORT"):
        ZenohSettings(connect=(endpoint,))


@pytest.mark.parametrize("name", ["inbox_capacity", "inbox_bytes", "message_limit_bytes"])
def test_limits_that_let_nothing_through_are_refused(name: str) -> None:
    with pytest.raises(InputError, match=f"{name} 0: at least 1"):
        ZenohSettings(**{name: 0})  # type: ignore[arg-type]


def test_protected_endpoints_need_certificates_and_certificates_protected_endpoints() -> None:
    with pytest.raises(InputError, match="authority_file"):
        ZenohSettings(connect=("tls/router:7447",))
    with pytest.raises(InputError, match="begins with 'tls/'"):
        ZenohSettings(connect=("tcp/router:7447",), tls=FILES)


def test_a_router_with_certificates_needs_a_register_and_the_other_way_round() -> None:
    with pytest.raises(InputError, match="register_file"):
        RouterSettings(listen=("tls/0.0.0.0:7447",), tls=FILES)
    with pytest.raises(InputError, match="register_file"):
        RouterSettings(listen=("tcp/127.0.0.1:7447",), register_file=Path("register.json"))
