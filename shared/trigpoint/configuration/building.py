"""Settings built from what was given, checked as a whole: everything that is wrong is said at once."""

import json
import math
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, dataclass, replace
from difflib import get_close_matches
from typing import Any, Generic, TypeVar

from pydantic import TypeAdapter, ValidationError

from trigpoint.configuration.given import Given, Layer, merged
from trigpoint.configuration.tree import KeyPath, Table, default_of, table_of
from trigpoint.errors import InputError
from trigpoint.observability.masking import without_password

SettingsT = TypeVar("SettingsT")
Values = Mapping[KeyPath, object]


class ConfigurationRefused(InputError):
    """Values that cannot be; `complaints` has a line for each."""

    def __init__(self, complaints: Sequence[str]) -> None:
        super().__init__("; ".join(complaints))
        self.complaints = tuple(complaints)


@dataclass(frozen=True, slots=True)
class Configured(Generic[SettingsT]):
    """The settings, and which value was given where; what is not in `given` is a default."""

    settings: SettingsT
    given: Mapping[KeyPath, Given]


def configured(kind: type[SettingsT], layers: Sequence[Layer]) -> Configured[SettingsT]:
    """Settings of a class from layers, a later one's values over an earlier one's.

    Raises ConfigurationRefused with everything that is wrong.
    """
    tree, given = table_of(kind), merged(layers)
    types, elsewhere = tree.value_types(), tree.set_elsewhere()
    complaints: list[str] = []
    values: dict[KeyPath, object] = {}
    for path, one in given.items():
        if path not in types:
            complaints.append(_unknown(path, one, tree, elsewhere))
            continue
        try:
            values[path] = _value(one, types[path])
        except InputError as error:
            complaints.append(f"{_named(path)} = {_shown(one.value)}: {error} ({one.origin})")
    if complaints:
        raise ConfigurationRefused(complaints)
    values |= {path: values[source] for path, source in elsewhere.items() if source in values}
    settings = _Building(values, complaints).built(tree, (), None)
    if complaints:
        raise ConfigurationRefused(complaints)
    assert isinstance(settings, kind)
    return Configured(settings, given)


@dataclass(frozen=True, slots=True)
class _Building:
    """Values on their way into the classes of a tree, and what is wrong with them."""

    values: Values
    complaints: list[str]

    def built(self, tree: Table, prefix: KeyPath, default: Any) -> object:
        """The tree's class with the values below the prefix; None with a complaint where it cannot be."""
        chosen = {path[-1]: value for path, value in self.values.items() if path[:-1] == prefix}
        for name, table in tree.tables.items():
            was = default_of(tree.kind, name) if default is None else getattr(default, name)
            if was is not None or self._has((*prefix, name)):
                chosen[name] = self.built(table, (*prefix, name), None if was is MISSING else was)
        missing = [name for name in tree.values if name not in chosen and default_of(tree.kind, name) is MISSING]
        if default is None and missing:
            self.complaints.extend(f"{_named((*prefix, name))}: has to be set" for name in missing)
            return None
        return self._made(tree.kind, chosen, prefix, default)

    def _has(self, prefix: KeyPath) -> bool:
        return any(path[: len(prefix)] == prefix for path in self.values)

    def _made(self, kind: Any, chosen: Mapping[str, object], prefix: KeyPath, default: Any) -> object:
        if not prefix and self.complaints:
            return None
        try:
            return kind(**chosen) if default is None else replace(default, **chosen)
        except (InputError, ValueError) as error:
            self.complaints.append(f"[{'.'.join(prefix)}] {error}" if prefix else str(error))
            return None


def _value(given: Given, kind: object) -> object:
    """The value as its key's type. Raises InputError with the limit it breaks."""
    adapter: TypeAdapter[object] = TypeAdapter(kind)  # type: ignore[arg-type]  # a field's type, Annotated or not
    try:
        if given.is_text:
            return _measured(_of_text(str(given.value), adapter))
        return _measured(adapter.validate_json(json.dumps(given.value), strict=True))
    except TypeError as error:
        raise InputError(f"a {type(given.value).__name__} is no value of any key") from error
    except ValidationError as error:
        raise InputError(_limits(error)) from error


def _measured(value: object) -> object:
    """The value, if it is no number or one that settings hold: each is a size, a duration, a count or a share."""
    if isinstance(value, int | float) and not 0 <= value < math.inf:
        raise InputError("should be a finite number of at least 0")
    return value


def _of_text(text: str, adapter: TypeAdapter[object]) -> object:
    """Text as the type: as it stands, or as TOML has it, or as a list parted by commas."""
    for reading in _readings(text):
        with suppress(ValidationError):
            return adapter.validate_json(json.dumps(reading))
    return adapter.validate_python(text)


def _readings(text: str) -> list[object]:
    try:
        return [text, tomllib.loads(f"value = {text}")["value"]]
    except (ValueError, RecursionError):  # no TOML, endless digits or brackets
        return [text, [part.strip() for part in text.split(",")] if text else []]


def _limits(error: ValidationError) -> str:
    return ", ".join(dict.fromkeys(one["msg"].removeprefix("Input ") for one in error.errors()))


def _unknown(path: KeyPath, given: Given, tree: Table, elsewhere: Mapping[KeyPath, KeyPath]) -> str:
    if path in elsewhere:
        return f"{_named(path)}: {_named(elsewhere[path])} sets it ({given.origin})"
    if len(path) == 1:
        return f"{path[0]}: stands in no section, and is no section itself ({given.origin})"
    if path[0] not in tree.tables:
        return f"no section [{path[0]}]{_nearest(path[0], list(tree.tables))} ({given.origin})"
    known = [".".join(found[1:]) for found in tree.value_types() if found[0] == path[0]]
    return f"[{path[0]}] has no key {'.'.join(path[1:])}{_nearest('.'.join(path[1:]), known)} ({given.origin})"


def _nearest(name: str, known: Sequence[str]) -> str:
    close = get_close_matches(name, known, n=1, cutoff=0.5)
    return f", but {close[0]}" if close else f", but {', '.join(known)}"


def _named(path: KeyPath) -> str:
    return f"[{path[0]}] {'.'.join(path[1:])}"


def _shown(value: object) -> str:
    return without_password(repr(value))
