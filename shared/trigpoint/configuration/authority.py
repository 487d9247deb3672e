"""A private authority: it signs the certificates of a fleet's vehicles, services, clients and routers.

Ed25519 keys, which Zenoh's TLS takes (tried with 1.10). Its folder: its key `authority.key`; `public` with its
certificate `authority.pem` and the register, for everyone to have; `issued` with a certificate and a key a name.
cryptography's one home.
"""

import datetime
import fcntl
import secrets
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import (
    BestAvailableEncryption,
    Encoding,
    KeySerializationEncryption,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from trigpoint.bus.register import REGISTER_NAME, Register, Registration, Role, read_register, write_register
from trigpoint.durable_files import replace_durably
from trigpoint.errors import InputError
from trigpoint.events.keys import valid_name

KEY_NAME, ISSUED_NAME, PUBLIC_NAME = "authority.key", "issued", "public"
CERTIFICATE_NAME, LOCK_NAME = "authority.pem", ".lock"
AUTHORITY_DAYS = 3650
DAYS_LIMIT = 825  # of an issued certificate: what is stolen unnoticed ends some day
CLOCK_SLACK_S = 300  # a certificate is valid this long before it was made: clocks differ
OWNER_ONLY = 0o600
PASSPHRASE_CHARACTERS = 8  # at least


@dataclass(frozen=True, slots=True)
class Issued:
    """A new certificate: its registration and its files."""

    row: Registration
    certificate_file: Path
    key_file: Path


class Authority:
    """The authority in a folder. Raises InputError for a folder that holds none, or a passphrase that is wrong."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        try:
            self._certificate = x509.load_pem_x509_certificate((folder / PUBLIC_NAME / CERTIFICATE_NAME).read_bytes())
        except (OSError, ValueError) as error:
            raise InputError(f"no authority in {folder}: {error}; `trigpoint certs init` makes one") from error

    @property
    def register_file(self) -> Path:
        """Where its register is."""
        return self._folder / PUBLIC_NAME / REGISTER_NAME

    @property
    def not_after_s(self) -> int:
        """When its own certificate ends, in Unix time."""
        return int(self._certificate.not_valid_after_utc.timestamp())

    def register(self) -> Register:
        """Every certificate it issued. Raises InputError for a register that cannot be read."""
        return read_register(self.register_file)

    def issue(
        self, name: str, role: Role, *, now_s: int, days: int, alternatives: Sequence[str], passphrase: bytes | None
    ) -> Issued:
        """A certificate and a key for a name; `alternatives` are the DNS names and addresses it is reached under.

        Raises InputError for a name, lifetime or alternative that cannot be.
        """
        if not 1 <= days <= DAYS_LIMIT:
            raise InputError(f"{days} days: 1 to {DAYS_LIMIT} are allowed")
        if role is Role.ROUTER and not alternatives:
            raise InputError("a router needs the names or addresses it is reached under: give at least one")
        not_after_s = min(now_s + days * 86_400, self.not_after_s)
        key = Ed25519PrivateKey.generate()
        with self._locked():
            register = self.register()
            common_name = register.next_common_name(name, role)
            certificate = self._signed(key, common_name, (now_s, not_after_s), alternatives, passphrase)
            row = Registration(
                name=name,
                common_name=common_name,
                role=role,
                serial=f"{certificate.serial_number:x}",
                not_after_s=not_after_s,
            )
            files = self._written(key, certificate, common_name)
            write_register(self.register_file, register.with_issued(row))
        return Issued(row, *files)

    def _written(self, key: Ed25519PrivateKey, certificate: x509.Certificate, common_name: str) -> tuple[Path, Path]:
        """The files of a certificate and its key."""
        issued = self._folder / ISSUED_NAME
        issued.mkdir(mode=0o700, exist_ok=True)
        files = issued / f"{common_name}.pem", issued / f"{common_name}.key"
        _write_key(files[1], key, NoEncryption())  # Zenoh reads no encrypted ones
        replace_durably(files[0], certificate.public_bytes(Encoding.PEM), mode=0o644)
        return files

    def revoke(self, name: str) -> Register:
        """The register without access for a name; its certificates and keys stay where they are.

        Raises InputError for a name without a certificate in force.
        """
        with self._locked():
            register = self.register().with_revoked(name)
            write_register(self.register_file, register)
        return register

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Nobody else changes the register: what one wrote, another does not overwrite."""
        with (self._folder / LOCK_NAME).open("w") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            yield

    def _signed(
        self,
        key: Ed25519PrivateKey,
        common_name: str,
        valid_s: tuple[int, int],
        alternatives: Sequence[str],
        passphrase: bytes | None,
    ) -> x509.Certificate:
        uses = [ExtendedKeyUsageOID.CLIENT_AUTH] + ([ExtendedKeyUsageOID.SERVER_AUTH] if alternatives else [])
        building = (
            _named(common_name, self._certificate.subject, key, valid_s)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(_key_usage(signs=False), critical=True)
            .add_extension(x509.ExtendedKeyUsage(uses), critical=False)
        )
        if alternatives:
            names = x509.SubjectAlternativeName([_general_name(text) for text in alternatives])
            building = building.add_extension(names, critical=False)
        return building.sign(self._key(passphrase), None)

    def _key(self, passphrase: bytes | None) -> Ed25519PrivateKey:
        path = self._folder / KEY_NAME
        try:
            key = load_pem_private_key(path.read_bytes(), passphrase)
        except (OSError, ValueError, TypeError) as error:
            raise InputError(f"the authority's key {path} cannot be opened: {error}") from error
        if not isinstance(key, Ed25519PrivateKey):
            raise InputError(f"the authority's key {path} is a {type(key).__name__}, not Ed25519")
        return key


def make_authority(folder: Path, *, name: str, now_s: int, passphrase: bytes | None) -> Authority:
    """A new authority in a folder. Raises InputError for a folder that holds one, and for a short passphrase."""
    valid_name(name)
    if passphrase is not None and len(passphrase) < PASSPHRASE_CHARACTERS:
        raise InputError(f"passphrase of {len(passphrase)} characters: at least {PASSPHRASE_CHARACTERS}")
    public = folder / PUBLIC_NAME
    if (folder / KEY_NAME).exists() or public.exists():
        raise InputError(f"{folder} holds an authority already: what it signed would be worthless with a new one")
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    public.mkdir(mode=0o755)
    key = Ed25519PrivateKey.generate()
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    certificate = (
        _named(name, subject, key, (now_s, now_s + AUTHORITY_DAYS * 86_400))
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_key_usage(signs=True), critical=True)
        .sign(key, None)
    )
    _write_key(folder / KEY_NAME, key, NoEncryption() if passphrase is None else BestAvailableEncryption(passphrase))
    replace_durably(public / CERTIFICATE_NAME, certificate.public_bytes(Encoding.PEM), mode=0o644)
    write_register(public / REGISTER_NAME, Register())
    return Authority(folder)


def _named(
    common_name: str, issuer: x509.Name, key: Ed25519PrivateKey, valid_s: tuple[int, int]
) -> x509.CertificateBuilder:
    after, before = (datetime.datetime.fromtimestamp(moment_s, tz=datetime.UTC) for moment_s in valid_s)
    return (
        x509.CertificateBuilder()
        .subject_name(x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)]))
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(secrets.randbits(126) + 1)
        .not_valid_before(after - datetime.timedelta(seconds=CLOCK_SLACK_S))
        .not_valid_after(before)
    )


def _key_usage(*, signs: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs,
        key_cert_sign=signs,
        crl_sign=signs,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _general_name(text: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ip_address(text))
    except ValueError:
        pass
    try:
        return x509.DNSName(text)
    except ValueError as error:
        raise InputError(f"{text!r} is neither an IP address nor a DNS name: {error}") from error


def _write_key(path: Path, key: Ed25519PrivateKey, encryption: KeySerializationEncryption) -> None:
    replace_durably(path, key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, encryption), mode=OWNER_ONLY)
