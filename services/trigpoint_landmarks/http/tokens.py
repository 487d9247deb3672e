"""Who may do what over HTTP: tokens in a file that holds their hashes only, each with a name and its scopes."""

import fcntl
import hashlib
import json
import os
import secrets
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from pathlib import Path

from trigpoint.errors import InputError
from trigpoint.events.keys import valid_name

LAYOUT = "trigpoint-tokens-1"
PREFIX = "tp_"  # by which scanners for leaked secrets know one
SECRET_BYTES = 32
OWNER_ONLY = 0o600
SIZE_LIMIT = 1_000_000  # bytes of the file


class Scope(StrEnum):
    """What a token allows; each allows what those before it do."""

    READ = "read"
    LABEL = "label"
    ADMINISTER = "administer"

    def allows(self, wanted: "Scope") -> bool:
        """Whether this scope is enough."""
        order = list(Scope)
        return order.index(self) >= order.index(wanted)


@dataclass(frozen=True, slots=True, kw_only=True)
class Token:
    """A token without its secret: `digest` is the secret's SHA-256, which nobody turns back."""

    name: str
    scope: Scope
    digest: str
    issued_s: int  # Unix time
    revoked: bool = False


@dataclass(frozen=True, slots=True)
class Tokens:
    """All tokens ever issued, in order."""

    rows: tuple[Token, ...] = ()

    def of_secret(self, secret: str) -> Token | None:
        """The token in force of a secret, None for any other text."""
        digest = digest_of(secret)
        found = [row for row in self.rows if secrets.compare_digest(row.digest, digest) and not row.revoked]
        return found[0] if found else None

    def in_force(self) -> dict[str, Token]:
        """The tokens in force by their digests."""
        return {row.digest: row for row in self.rows if not row.revoked}


def digest_of(secret: str) -> str:
    """What is kept of a secret: it is random enough that a plain hash can be."""
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest()


def read_tokens(path: Path) -> Tokens:
    """The tokens of a file. Raises InputError for one that is not there or is none."""
    try:
        content = path.read_bytes()
        if len(content) > SIZE_LIMIT:
            raise ValueError(f"{len(content)} bytes, at most {SIZE_LIMIT}")
        values = json.loads(content)
        if values["layout"] != LAYOUT:
            raise ValueError(f"layout {values['layout']!r}")
        return Tokens(tuple(Token(**{**row, "scope": Scope(row["scope"])}) for row in values["tokens"]))
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"token file {path} cannot be read: {error}") from error


def issue_token(path: Path, name: str, scope: Scope, *, now_s: int) -> tuple[Token, str]:
    """A new token in the file, made where it is not there yet, and its secret, which is nowhere else.

    Raises InputError for a name that is none or has a token in force.
    """
    valid_name(name)
    secret = PREFIX + secrets.token_urlsafe(SECRET_BYTES)
    token = Token(name=name, scope=scope, digest=digest_of(secret), issued_s=now_s)
    with _locked(path):
        tokens = read_tokens(path) if path.exists() else Tokens()
        if any(row.name == name and not row.revoked for row in tokens.rows):
            raise InputError(f"token {name!r} is in force: revoke it first, or take another name")
        _write(path, (*tokens.rows, token))
    return token, secret


def revoke_token(path: Path, name: str) -> Token:
    """The token of a name, from now on of no use. Raises InputError where no such token is in force."""
    with _locked(path):
        tokens = read_tokens(path)
        found = [row for row in tokens.rows if row.name == name and not row.revoked]
        if not found:
            there = ", ".join(row.name for row in tokens.rows if not row.revoked) or "none"
            raise InputError(f"no token {name!r} is in force; there are {there}")
        revoked = replace(found[0], revoked=True)
        _write(path, [revoked if row is found[0] else row for row in tokens.rows])
    return revoked


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Nobody else changes the file. Raises InputError where its folder is not there."""
    try:
        handle = os.open(path.with_name(f"{path.name}.lock"), os.O_RDWR | os.O_CREAT, OWNER_ONLY)
    except OSError as error:
        raise InputError(f"token file {path} cannot be written: {error}") from error
    with os.fdopen(handle, "r+") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _write(path: Path, rows: Sequence[Token]) -> None:
    """The file replaced whole, readable for its owner only."""
    fresh = path.with_name(f"{path.name}.new")
    fresh.unlink(missing_ok=True)
    handle = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL, OWNER_ONLY)
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(json.dumps({"layout": LAYOUT, "tokens": [asdict(row) for row in rows]}, indent=1) + "\n")
        file.flush()
        os.fsync(file.fileno())
    fresh.replace(path)


class TokenFile:
    """A token file as it is now: looked at again at most every `look_s`, read again where it has changed."""

    def __init__(self, path: Path, *, look_s: float = 1.0) -> None:
        self._path, self._look_s = path, look_s
        self._seen: tuple[int, int, int] | None = None
        self._looked_s = float("-inf")
        self._in_force: dict[str, Token] = {}
        self._refresh()

    def token_of(self, secret: str, *, now_s: float) -> Token | None:
        """The token in force of a secret. Raises InputError for a file that can no longer be read."""
        if now_s - self._looked_s >= self._look_s:
            self._looked_s = now_s
            self._refresh()
        return self._in_force.get(digest_of(secret))

    def _refresh(self) -> None:
        try:
            status = self._path.stat()
        except OSError as error:
            raise InputError(f"token file {self._path} cannot be read: {error}") from error
        seen = (status.st_mtime_ns, status.st_size, status.st_ino)
        if seen != self._seen:
            self._in_force = read_tokens(self._path).in_force()
            self._seen = seen
