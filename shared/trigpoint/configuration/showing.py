"""A configuration as it was merged: every value with where it comes from, without secrets."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

from trigpoint.configuration.building import Configured
from trigpoint.configuration.tree import KeyPath, table_of
from trigpoint.observability.masking import without_password

DEFAULT = "default"


@dataclass(frozen=True, slots=True, kw_only=True)
class ShownValue:
    """One value as it may be shown, and its origin."""

    path: KeyPath
    value: Any
    origin: str


def shown_values(configured: Configured[Any]) -> Iterator[ShownValue]:
    """Every value of a configuration in the order of its class; tables that are not there are left out."""
    for path in table_of(type(configured.settings)).value_types():
        found, value = _at(configured.settings, path)
        if found:
            given = configured.given.get(path)
            yield ShownValue(path=path, value=_plain(value), origin=given.origin if given else DEFAULT)


def toml_lines(values: Iterator[ShownValue]) -> Iterator[str]:
    """The values as TOML, each with its origin as a comment."""
    table: KeyPath = ()
    for one in values:
        if one.path[:-1] != table:
            table = one.path[:-1]
            yield f"[{'.'.join(table)}]"
        said = f"# {one.path[-1]} is not set" if one.value is None else f"{one.path[-1]} = {_toml(one.value)}"
        yield f"{said}  # {one.origin}"


def _at(settings: object, path: KeyPath) -> tuple[bool, object]:
    for name in path:
        if settings is None:
            return False, None
        settings = getattr(settings, name)
    return True, settings


def _plain(value: object) -> Any:
    if isinstance(value, frozenset | set):
        return sorted(_plain(item) for item in value)
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, str | Path):
        return without_password(str(value))
    return value


def _toml(value: Any) -> str:
    return json.dumps(value)
