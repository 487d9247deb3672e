"""What was set where: a TOML file, the environment, and flags, as values with their origin."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from trigpoint.configuration.tree import KeyPath
from trigpoint.errors import InputError
from trigpoint.observability.masking import without_password

PREFIX, SEPARATOR = "TRIGPOINT_", "__"
SIZE_LIMIT = 1_000_000  # bytes of a configuration file


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """One value as it was set, and where; text from outside of TOML is still to be read as its key's type."""

    value: object
    origin: str
    is_text: bool


Layer = Mapping[KeyPath, Given]


def from_toml(path: Path) -> Layer:
    """The values of a TOML file. Raises InputError, which names the file and the line."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: no configuration can be read here: {error.strerror}") from error
    if len(content) > SIZE_LIMIT:
        raise InputError(f"{path}: {len(content)} bytes are no configuration; at most {SIZE_LIMIT}")
    try:
        tables = tomllib.loads(content.decode("utf-8"))
    except (ValueError, RecursionError) as error:  # no text, no TOML, endless digits or brackets
        raise InputError(f"{path}: no TOML: {error}") from error
    return {key: Given(value=value, origin=str(path), is_text=False) for key, value in _flat(tables)}


def from_environment(environment: Mapping[str, str]) -> Layer:
    """The values of all variables named TRIGPOINT_<SECTION>__<KEY>."""
    return {
        tuple(name.removeprefix(PREFIX).lower().split(SEPARATOR)): Given(
            value=text, origin=f"environment {name}", is_text=True
        )
        for name, text in environment.items()
        if name.startswith(PREFIX) and SEPARATOR in name
    }


def from_flags(words: Sequence[str]) -> Layer:
    """The values of flags "section.key=value". Raises InputError for one of another form."""
    return dict(_flag(word) for word in words)


def _flag(word: str) -> tuple[KeyPath, Given]:
    name, equals, text = word.partition("=")
    path = tuple(name.strip().split("."))
    if not equals or len(path) < 2:
        raise InputError(f"--set {name}: SECTION.KEY=VALUE is needed")
    if without_password(text) != text:
        raise InputError(f"--set {name}: holds a password, which every process list would show; use a file of it")
    return path, Given(value=text, origin="flag --set", is_text=True)


def merged(layers: Sequence[Layer]) -> dict[KeyPath, Given]:
    """The values of all layers; a later one's win."""
    return {path: given for layer in layers for path, given in layer.items()}


def _flat(tables: Mapping[str, Any], prefix: KeyPath = ()) -> Iterator[tuple[KeyPath, object]]:
    for name, value in tables.items():
        if isinstance(value, dict):
            yield from _flat(value, (*prefix, name))
        else:
            yield (*prefix, name), value
