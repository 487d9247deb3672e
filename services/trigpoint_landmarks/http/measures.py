"""What the HTTP service counts and measures of requests, by the pattern of their paths."""

import re
from collections.abc import Callable, Iterable
from itertools import groupby

from trigpoint.observability.metrics import Instruments

Counted = Callable[[], None]
Measured = Callable[[float], None]

UNKNOWN = "other"  # whatever path nobody serves: its own text would be a label without end
BUSIEST = ("/tiles/{name}/{zoom}/{column}/{row}", "/collections/{name}/items")


class RequestMeasures:
    """Requests by route template and status, and how long they took."""

    def __init__(self, instruments: Instruments, templates: Iterable[str]) -> None:
        self._instruments = instruments
        self._of: dict[tuple[str, int], tuple[Counted, Measured]] = {}  # looked up once: it takes longer than counting
        ordered = [one for one, _ in groupby((*BUSIEST, *templates))]
        self._patterns = [(re.compile(_pattern(one)), _plain(one)) for one in ordered]

    def answered(self, path: str, status: int, *, seconds: float) -> None:
        """One request answered in full."""
        route = self._route(path)
        of = self._of.get((route, status))
        if of is None:
            counter, histogram = self._instruments.requests, self._instruments.request_seconds
            of = counter.labels(route, str(status)).inc, histogram.labels(route).observe
            self._of[route, status] = of
        of[0]()
        of[1](seconds)

    def _route(self, path: str) -> str:
        return next((name for pattern, name in self._patterns if pattern.fullmatch(path)), UNKNOWN)


def _pattern(template: str) -> str:
    """A template as a regular expression: `{x}` is anything up to the next slash, `{x:path}` anything at all."""
    parts = re.split(r"(\{[^}]*\})", template)
    return "".join(_of_part(one) for one in parts)


def _of_part(part: str) -> str:
    if not part.startswith("{"):
        return re.escape(part)
    return ".*" if part.endswith(":path}") else "[^/]+"


def _plain(template: str) -> str:
    return template.replace(":path}", "}")
