"""`trigpoint certs`: a private authority for the bus: who takes part in a fleet, and as what."""

import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click

from trigpoint.bus.register import Registration, Role
from trigpoint.configuration.authority import Authority, make_authority
from trigpoint.errors import InputError
from trigpoint_cli.output import Answer, JsonObject, Screen, answering

DEFAULT_DAYS = 365
SOON_DAYS = 30  # before its end a certificate is warned of
DAY_S = 86_400

PASSPHRASE = click.option(
    "--passphrase-file",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="A file with the passphrase of the authority's key.",
)
FOLDER = click.option(
    "--authority",
    "folder",
    metavar="DIR",
    type=click.Path(path_type=Path),
    default=Path("authority"),
    show_default=True,
    help="The authority's folder.",
)


@click.group("certs", help="A private authority for the bus: who takes part in a fleet, and as what.")
def command() -> None:
    """Group of what an authority does."""


@command.command("init")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--name", default="trigpoint authority", show_default=True, help="The authority's own name.")
@PASSPHRASE
@answering
def init(folder: Path, name: str, passphrase_file: Path | None, *, screen: Screen) -> Answer:
    """Make an authority in DIR; keep its key away from vehicles, services and routers."""
    authority = make_authority(folder, name=name, now_s=_now_s(), passphrase=_passphrase(passphrase_file))
    values = {"folder": str(folder), "register": str(authority.register_file), "not_after_s": authority.not_after_s}
    return Answer(values, (f"an authority is in {folder}, valid until {_day(authority.not_after_s)}",))


@command.command("issue")
@click.argument("name")
@click.option("--role", required=True, type=click.Choice([role.value for role in Role]))
@click.option("--san", "alternatives", multiple=True, metavar="NAME|ADDRESS", help="What it is reached under; routers.")
@click.option("--days", type=int, default=DEFAULT_DAYS, show_default=True)
@FOLDER
@PASSPHRASE
@answering
def issue(name: str, role: str, folder: Path, passphrase_file: Path | None, *, screen: Screen, **wanted: Any) -> Answer:
    """Make a certificate and a key for NAME; again: a new one, beside which the old one holds until its end."""
    issued = Authority(folder).issue(
        name,
        Role(role),
        now_s=_now_s(),
        passphrase=_passphrase(passphrase_file),
        **wanted,
    )
    files = {"certificate_file": str(issued.certificate_file), "key_file": str(issued.key_file)}
    lines = (f"{name}: {role}, until {_day(issued.row.not_after_s)}", *files.values())
    return Answer({**_values(issued.row), **files}, lines)


@command.command("revoke")
@click.argument("name")
@FOLDER
@answering
def revoke(name: str, folder: Path, *, screen: Screen) -> Answer:
    """Take NAME out of the register: a router that reads this register refuses it within a second.

    A router with a copy of it refuses it once it has the new copy.
    """
    authority = Authority(folder)
    authority.revoke(name)
    left = len(authority.register().in_force())
    values = {"name": name, "register": str(authority.register_file), "in_force": left}
    return Answer(values, (f"{name} is revoked; {left} names are in force",))


@command.command("list")
@FOLDER
@answering
def list_command(folder: Path, *, screen: Screen) -> Answer:
    """List every certificate, with warnings of those that end soon."""
    authority, now_s = Authority(folder), _now_s()
    register = authority.register()
    rows = [{**_values(row), "state": _state(row, now_s)} for row in register.rows]
    warnings = [_warning(row.common_name, row.not_after_s, now_s) for row in register.in_force()]
    warnings.append(_warning("the authority itself", authority.not_after_s, now_s))
    told = [warning for warning in warnings if warning]
    lines = [f"{row['common_name']}: {row['role']}, {row['state']}, until {_day(row['not_after_s'])}" for row in rows]
    values: JsonObject = {"certificates": rows, "not_after_s": authority.not_after_s, "warnings": told}
    return Answer(values, (*lines, *told))


def _values(row: Registration) -> JsonObject:
    return {
        "name": row.name,
        "common_name": row.common_name,
        "role": row.role.value,
        "serial": row.serial,
        "not_after_s": row.not_after_s,
    }


def _state(row: Registration, now_s: int) -> str:
    if row.revoked:
        return "revoked"
    return "expired" if row.not_after_s <= now_s else "in force"


def _warning(name: str, not_after_s: int, now_s: int) -> str:
    left_days = (not_after_s - now_s) / DAY_S
    if left_days <= 0.0:
        return f"{name} ended on {_day(not_after_s)}"
    return f"{name} ends in {left_days:.0f} days" if left_days < SOON_DAYS else ""


def _passphrase(path: Path | None) -> bytes | None:
    if path is None:
        return None
    try:
        return path.read_bytes().rstrip(b"\r\n")
    except OSError as error:
        raise InputError(f"passphrase file {path} cannot be read: {error.strerror}") from error


def _day(moment_s: int) -> str:
    return datetime.fromtimestamp(moment_s, tz=UTC).strftime("%Y-%m-%d")


def _now_s() -> int:
    return int(time.time())
