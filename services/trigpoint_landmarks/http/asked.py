"""What a request asks: its parameters, each once, and the address links begin with."""

import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import parse_qsl, quote, urlencode

from trigpoint.errors import InputError

PARAMETERS_MOST = 40
QUERY_LIMIT = 65_536  # bytes
NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?\s*", re.ASCII)
HOST = re.compile(r"[A-Za-z0-9.\-]{1,253}(:[0-9]{1,5})?|\[[0-9A-Fa-f:.]{2,45}\](:[0-9]{1,5})?")


@dataclass(frozen=True, slots=True)
class Asked:
    """A request's parameters by name, and its address without them."""

    base_url: str
    path: str
    parameters: Mapping[str, str] = field(default_factory=dict)

    def require_only(self, known: Collection[str]) -> None:
        """Raises InputError for a parameter that has no meaning here."""
        unknown = [name for name in self.parameters if name not in known]
        if unknown:
            raise InputError(f"parameter {unknown[0][:40]!r} is not known here; there are {', '.join(sorted(known))}")

    def whole(self, name: str) -> int | None:
        """A whole number that was given. Raises InputError for any other text."""
        text = self.parameters.get(name)
        if text is None:
            return None
        if not re.fullmatch(r"[+-]?[0-9]{1,18}", text):
            raise InputError(f"{name} {text[:40]!r} is no whole number")
        return int(text)

    def number(self, name: str, default: float | None = None, *, least: float, most: float) -> float:
        """A number between two limits. Raises InputError for any other text, and where none is given nor usual."""
        text = self.parameters.get(name)
        if text is None:
            if default is None:
                raise InputError(f"{name} is needed: a number from {least:g} to {most:g}")
            return default
        (value,) = numbers_of(text, (1,), "a number")
        if not least <= value <= most:
            raise InputError(f"{name} {text[:40]} is outside {least:g} to {most:g}")
        return value

    def text(self, name: str, *, limit: int) -> str:
        """A text, empty where none is given. Raises InputError for one that is too long."""
        text = self.parameters.get(name, "")
        if len(text) > limit:
            raise InputError(f"{name} has {len(text)} characters: {limit} at most")
        return text

    def url(self, path: str | None = None, /, **changed: object) -> str:
        """The address of a path, with parameters; of this request's own path where none is given, with its own too."""
        own = self.parameters if path is None else {}
        named = {**own, **{name: str(value) for name, value in changed.items() if value is not None}}
        query = f"?{urlencode(named)}" if named else ""
        return f"{self.base_url}{self.path if path is None else path}{query}"


def asked_of(scope: Mapping[str, Any], *, public_url: str) -> Asked:
    """What a request asks. Raises InputError for parameters that are doubled, too many, or no text."""
    query: bytes = scope["query_string"]
    parameters: dict[str, str] = {}
    if query:
        if len(query) > QUERY_LIMIT:
            raise InputError(f"parameters of {len(query)} bytes: at most {QUERY_LIMIT}")
        parameters = _parameters(query)
    return Asked(public_url.rstrip("/") or _called(scope), quote(scope["path"]), parameters)


def _parameters(query: bytes) -> dict[str, str]:
    try:
        pairs = parse_qsl(
            query.decode("ascii"), keep_blank_values=True, errors="strict", max_num_fields=PARAMETERS_MOST
        )
    except ValueError as error:
        raise InputError("the parameters cannot be read: they are percent-encoded UTF-8, 40 at most") from error
    parameters: dict[str, str] = {}
    for name, value in pairs:
        if name in parameters:
            raise InputError(f"parameter {name[:40]!r} is given twice")
        if "\0" in value:
            raise InputError(f"parameter {name[:40]!r} holds a character that no database keeps")
        parameters[name] = value
    return parameters


def numbers_of(text: str, counts: Collection[int], form: str) -> list[float]:
    """The finite numbers of a text, with commas between them, one of `counts` many. Raises InputError."""
    parts = text.split(",")
    if len(parts) not in counts or not all(map(NUMBER.fullmatch, parts)):
        raise InputError(f"{text[:100]!r} is not {form}, numbers with commas between them")
    numbers = [float(part) for part in parts]
    if not all(map(math.isfinite, numbers)):
        raise InputError(f"{text[:100]!r} holds a number too large")
    return numbers


def host_of(scope: Mapping[str, Any]) -> str:
    """The host a client called, as it says; the server's own address where it says none that can be."""
    stated = next((value for name, value in scope["headers"] if name == b"host"), b"").decode("latin-1")
    if HOST.fullmatch(stated):
        return str(stated)
    host, port = scope.get("server") or ("localhost", 80)
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def _called(scope: Mapping[str, Any]) -> str:
    return f"{scope.get('scheme', 'http')}://{host_of(scope)}"
