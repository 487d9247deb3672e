"""`trigpoint certs`: what the authority hands out, and what it does not."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.serialization import load_pem_private_key

from command_runs.running import trigpoint

PASSPHRASE = "correct horse battery"


@pytest.fixture
def authority(tmp_path: Path) -> Path:
    assert trigpoint("certs", "init", tmp_path / "authority", "--name", "fleet").status == 0
    return tmp_path / "authority"


def issued(authority: Path, *words: str) -> x509.Certificate:
    run = trigpoint("certs", "issue", *words, "--authority", authority, "--json")
    assert run.status == 0, run.err
    return x509.load_pem_x509_certificate(Path(run.answer["certificate_file"]).read_bytes())


def test_a_certificate_names_its_owner_and_is_signed_by_the_authority(authority: Path) -> None:
    certificate = issued(authority, "veh-a", "--role", "vehicle")
    certificate.verify_directly_issued_by(
        x509.load_pem_x509_certificate((authority / "public" / "authority.pem").read_bytes())
    )
    assert certificate.subject.rfc4514_string() == "CN=veh-a"


def test_keys_are_readable_by_their_owner_only(authority: Path) -> None:
    issued(authority, "veh-a", "--role", "vehicle")
    keys = [authority / "authority.key", authority / "issued" / "veh-a.key"]
    assert [key.stat().st_mode & 0o777 for key in keys] == [0o600, 0o600]


def test_the_authoritys_key_is_encrypted_where_a_passphrase_is_given(tmp_path: Path) -> None:
    secret = tmp_path / "passphrase"
    secret.write_text(f"{PASSPHRASE}\n", encoding="utf-8")
    folder = tmp_path / "authority"
    assert trigpoint("certs", "init", folder, "--passphrase-file", secret).status == 0
    assert load_pem_private_key((folder / "authority.key").read_bytes(), PASSPHRASE.encode()) is not None
    refused = trigpoint("certs", "issue", "veh-a", "--role", "vehicle", "--authority", folder)
    assert refused.status == 2
    opened = trigpoint(
        "certs", "issue", "veh-a", "--role", "vehicle", "--authority", folder, "--passphrase-file", secret
    )
    assert opened.status == 0


def test_a_second_authority_does_not_replace_the_first(authority: Path) -> None:
    before = (authority / "authority.key").read_bytes()
    assert trigpoint("certs", "init", authority).status == 2
    assert (authority / "authority.key").read_bytes() == before


def test_a_router_has_the_names_it_is_reached_under(authority: Path) -> None:
    words = ("router", "--role", "router", "--san", "router.fleet.internal", "--san", "127.0.0.1")
    names = issued(authority, *words).extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert names.get_values_for_type(x509.DNSName) == ["router.fleet.internal"]
    assert trigpoint("certs", "issue", "r2", "--role", "router", "--authority", authority).status == 2


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("veh/*", "--role", "vehicle"), "none of * ? # $ /"),
        (("veh-a", "--role", "vehicle", "--days", "0"), "1 to 825"),
        (("veh-a", "--role", "vehicle", "--days", "826"), "1 to 825"),
        (("veh-a", "--role", "king"), "Invalid value"),
        (("veh-a", "--role", "vehicle", "--san", "ümlaut.example"), "neither an IP address nor a DNS name"),
    ],
)
def test_what_cannot_be_issued_is_refused_and_leaves_no_trace(
    authority: Path, words: tuple[str, ...], complaint: str
) -> None:
    run = trigpoint("certs", "issue", *words, "--authority", authority)
    assert (run.status, complaint in run.err) == (2, True), run.err
    assert not (authority / "issued").exists() or not any((authority / "issued").iterdir())


def test_a_revoked_name_is_listed_as_such_and_its_next_certificate_has_another_common_name(authority: Path) -> None:
    issued(authority, "veh-a", "--role", "vehicle")
    assert trigpoint("certs", "revoke", "veh-a", "--authority", authority, "--json").answer["in_force"] == 0
    assert issued(authority, "veh-a", "--role", "vehicle").subject.rfc4514_string() == "CN=veh-a.2"
    listed = trigpoint("certs", "list", "--authority", authority, "--json").answer["certificates"]
    assert [(row["common_name"], row["state"]) for row in listed] == [("veh-a", "revoked"), ("veh-a.2", "in force")]


def test_a_certificate_that_ends_soon_is_warned_of(authority: Path) -> None:
    issued(authority, "veh-a", "--role", "vehicle", "--days", "10")
    issued(authority, "veh-b", "--role", "vehicle", "--days", "100")
    (warning,) = trigpoint("certs", "list", "--authority", authority, "--json").answer["warnings"]
    assert warning == "veh-a ends in 10 days"


def test_the_register_holds_no_key(authority: Path) -> None:
    issued(authority, "veh-a", "--role", "vehicle")
    assert set(json.loads((authority / "public" / "register.json").read_text())["certificates"][0]) == {
        "name",
        "common_name",
        "role",
        "serial",
        "not_after_s",
        "revoked",
    }


def test_certificates_issued_at_once_are_all_registered_and_no_revocation_is_lost(authority: Path) -> None:
    issued(authority, "veh-lost", "--role", "vehicle")
    words = [("issue", f"veh-{number}", "--role", "vehicle") for number in range(8)]
    commands = [*words[:4], ("revoke", "veh-lost"), *words[4:]]
    started = [
        subprocess.Popen([sys.executable, "-m", "trigpoint_cli", "certs", *command, "--authority", str(authority)])
        for command in commands
    ]
    assert [one.wait() for one in started] == [0] * 9
    listed = trigpoint("certs", "list", "--authority", authority, "--json").answer["certificates"]
    states = {row["name"]: row["state"] for row in listed}
    assert states == {"veh-lost": "revoked", **{f"veh-{number}": "in force" for number in range(8)}}
