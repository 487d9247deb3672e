"""The register of an authority: every name it gave a certificate to, in which role, and which were revoked.

A JSON file without secrets; the router reads it to know who may do what.
"""

import json
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Self

from trigpoint.durable_files import replace_durably
from trigpoint.errors import InputError
from trigpoint.events.keys import valid_name

REGISTER_NAME = "register.json"
LAYOUT = "trigpoint-register-1"


class Role(StrEnum):
    """What a certificate's owner is; `service` is all of them, for a machine that runs them together."""

    VEHICLE = "vehicle"
    INGEST = "ingest"
    FILTERING = "filtering"
    PERCEPTION = "perception"
    OPTIMISATION = "optimisation"
    LANDMARKS = "landmarks"
    ANSWERS = "answers"
    HTTP = "http"
    SERVICE = "service"
    CLIENT = "client"
    ROUTER = "router"


@dataclass(frozen=True, slots=True, kw_only=True)
class Registration:
    """One certificate: for a vehicle `name` is the one in its keys; `common_name` stands in the certificate.

    The two differ after a revocation: a name's next certificate must not share the revoked one's common name.
    """

    name: str
    common_name: str
    role: Role
    serial: str
    not_after_s: int  # Unix time
    revoked: bool = False


@dataclass(frozen=True, slots=True)
class Register:
    """All registrations, in the order of issue."""

    rows: tuple[Registration, ...] = ()

    def in_force(self) -> tuple[Registration, ...]:
        """The registrations that give access: one for each common name that is not revoked, the newest."""
        revoked = {row.common_name for row in self.rows if row.revoked}
        return tuple({row.common_name: row for row in self.rows if row.common_name not in revoked}.values())

    def next_common_name(self, name: str, role: Role) -> str:
        """The common name of a name's next certificate. Raises InputError for a name in force in another role."""
        valid_name(name)
        own = [row for row in self.rows if row.name == name]
        for row in own:
            if row.role is not role and not row.revoked:
                raise InputError(f"name {name!r} is in force as {row.role}: revoke it first, or choose another name")
        generation = len({row.common_name for row in own if row.revoked}) + 1
        common_name = name if generation == 1 else f"{name}.{generation}"
        taken = [row.name for row in self.rows if row.common_name == common_name and row.name != name]
        if taken:
            raise InputError(f"common name {common_name!r} is that of {taken[0]!r}: choose another name")
        return common_name

    def with_issued(self, row: Registration) -> Self:
        """The register with one more certificate."""
        return replace(self, rows=(*self.rows, row))

    def with_revoked(self, name: str) -> Self:
        """The register without access for a name. Raises InputError for one that has none."""
        if not any(row.name == name and not row.revoked for row in self.rows):
            known = ", ".join(dict.fromkeys(row.name for row in self.rows if not row.revoked)) or "none"
            raise InputError(f"name {name!r} has no certificate in force: there are {known}")
        return replace(self, rows=tuple(replace(row, revoked=row.revoked or row.name == name) for row in self.rows))


def read_register(path: Path) -> Register:
    """The register in a file. Raises InputError for a file that is not there or is not one."""
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
        if values["layout"] != LAYOUT:
            raise InputError(f"register {path}: layout {values['layout']!r}, not {LAYOUT!r}")
        rows = tuple(Registration(**{**row, "role": Role(row["role"])}) for row in values["certificates"])
        for row in rows:
            valid_name(row.name)
            valid_name(row.common_name)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"register {path} cannot be read: {error}") from error
    return Register(rows)


def write_register(path: Path, register: Register) -> None:
    """The file replaced whole, so that a reader sees the old register or the new one, also after a loss of power."""
    values = {"layout": LAYOUT, "certificates": [asdict(row) for row in register.rows]}
    replace_durably(path, (json.dumps(values, indent=1) + "\n").encode())
