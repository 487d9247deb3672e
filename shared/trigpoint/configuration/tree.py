"""The keys of a tree of settings: a class whose fields are sections, whose fields are values or tables again."""

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from trigpoint.configuration.limits import SetElsewhere

KeyPath = tuple[str, ...]
"""A section, the tables in it, and a key: ("optimisation", "anchors", "gate_sigmas")."""


@dataclass(frozen=True, slots=True)
class Table:
    """A class of settings: its tables, its values' types, and the values that keys of other sections set."""

    kind: type
    tables: Mapping[str, "Table"]
    values: Mapping[str, object]
    elsewhere: Mapping[str, KeyPath]

    def value_types(self, prefix: KeyPath = ()) -> dict[KeyPath, object]:
        """The type of every value below, by its path; without those that are set elsewhere."""
        found = {(*prefix, name): kind for name, kind in self.values.items() if name not in self.elsewhere}
        for name, table in self.tables.items():
            found |= table.value_types((*prefix, name))
        return found

    def set_elsewhere(self, prefix: KeyPath = ()) -> dict[KeyPath, KeyPath]:
        """Which key sets the values that have none of their own."""
        found: dict[KeyPath, KeyPath] = {(*prefix, name): path for name, path in self.elsewhere.items()}
        for name, table in self.tables.items():
            found |= table.set_elsewhere((*prefix, name))
        return found


def table_of(kind: type, elsewhere: Mapping[str, KeyPath] | None = None) -> Table:
    """The keys of a class of settings."""
    tables: dict[str, Table] = {}
    values: dict[str, object] = {}
    for name, hint in get_type_hints(kind, include_extras=True).items():
        nested = _settings_class(hint)
        if nested is not None:
            tables[name] = table_of(nested, _elsewhere(hint))
        else:
            values[name] = hint
    return Table(kind, tables, values, elsewhere or {})


def default_of(kind: type, name: str) -> object:
    """A field's default, or MISSING."""
    (field,) = (field for field in fields(kind) if field.name == name)
    if field.default_factory is not MISSING:
        return field.default_factory()
    return field.default


def _settings_class(hint: object) -> type | None:
    if get_origin(hint) is Annotated:
        return _settings_class(get_args(hint)[0])
    if get_origin(hint) in (Union, UnionType):
        kinds: list[Any] = [part for part in get_args(hint) if part is not NoneType]
        return _settings_class(kinds[0]) if len(kinds) == 1 else None
    return hint if isinstance(hint, type) and is_dataclass(hint) else None


def _elsewhere(hint: object) -> dict[str, KeyPath]:
    if get_origin(hint) is not Annotated:
        return {}
    marks = [mark for mark in get_args(hint)[1:] if isinstance(mark, SetElsewhere)]
    return {name: tuple(path.split(".")) for mark in marks for name, path in mark.fields}
