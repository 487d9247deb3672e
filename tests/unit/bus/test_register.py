"""The register of certificates: names, generations, revocation, and the file."""

from pathlib import Path

import pytest

from trigpoint.bus.register import Register, Registration, Role, read_register, write_register
from trigpoint.errors import InputError


def row(name: str, *, common_name: str = "", role: Role = Role.VEHICLE, serial: str = "1") -> Registration:
    return Registration(name=name, common_name=common_name or name, role=role, serial=serial, not_after_s=2_000_000_000)


def test_a_file_gives_back_what_was_written(tmp_path: Path) -> None:
    register = Register((row("veh-a"), row("ingest", role=Role.INGEST))).with_revoked("veh-a")
    write_register(tmp_path / "register.json", register)
    assert read_register(tmp_path / "register.json") == register


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        '{"layout": "trigpoint-register-2", "certificates": []}',
        '{"layout": "trigpoint-register-1", "certificates": [{"name": "veh-a"}]}',
        '{"layout": "trigpoint-register-1", "certificates": [{"name": "**", "common_name": "**", "role": "vehicle", '
        '"serial": "1", "not_after_s": 1, "revoked": false}]}',
    ],
)
def test_a_file_that_is_no_register_is_refused_whole(tmp_path: Path, text: str) -> None:
    path = tmp_path / "register.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError):
        read_register(path)


def test_a_renewed_certificate_keeps_the_common_name_and_the_newest_counts() -> None:
    register = Register((row("veh-a"), row("veh-a", serial="2")))
    assert register.next_common_name("veh-a", Role.VEHICLE) == "veh-a"
    assert [one.serial for one in register.in_force()] == ["2"]


def test_after_a_revocation_the_next_certificate_has_another_common_name() -> None:
    register = Register((row("veh-a"),)).with_revoked("veh-a")
    second = register.with_issued(row("veh-a", common_name=register.next_common_name("veh-a", Role.VEHICLE)))
    third = second.with_revoked("veh-a")
    assert second.next_common_name("veh-a", Role.VEHICLE) == "veh-a.2"
    assert third.next_common_name("veh-a", Role.VEHICLE) == "veh-a.3"


def test_a_name_cannot_take_anothers_common_name() -> None:
    register = Register((row("veh-a"),)).with_revoked("veh-a").with_issued(row("veh-a.2"))
    with pytest.raises(InputError, match=r"veh-a\.2"):
        register.next_common_name("veh-a", Role.VEHICLE)


def test_a_name_has_one_role_at_a_time() -> None:
    with pytest.raises(InputError, match="in force as vehicle"):
        Register((row("veh-a"),)).next_common_name("veh-a", Role.INGEST)


@pytest.mark.parametrize("name", ["", "veh/a", "veh*", "**", "veh?", "$veh", "#", "@veh", "veh\n", "x" * 61])
def test_a_name_that_zenoh_would_read_otherwise_is_refused(name: str) -> None:
    with pytest.raises(InputError):
        Register().next_common_name(name, Role.VEHICLE)


def test_revoking_a_name_that_has_nothing_names_those_that_have() -> None:
    with pytest.raises(InputError, match="veh-a"):
        Register((row("veh-a"),)).with_revoked("veh-b")
