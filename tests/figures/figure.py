"""What a figure is: a measure, its unit, its target, and the command it comes from."""

import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from figures.workbench import CommandFailed, Workbench


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """A target: at least, at most, or both, ends included."""

    at_least: float | None = None
    at_most: float | None = None

    def hold(self, value: float) -> bool:
        """Whether a value keeps to both; NaN never does."""
        above = self.at_least is None or value >= self.at_least
        below = self.at_most is None or value <= self.at_most
        return above and below and value == value

    def __str__(self) -> str:
        parts = (("at least", self.at_least), ("at most", self.at_most))
        return ", ".join(f"{word} {limit:g}" for word, limit in parts if limit is not None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """A value and the last command it was read from."""

    value: float
    command: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One promise of one group; `target` is None for a figure that is only reported."""

    name: str
    unit: str
    target: Bounds | None
    measure: Callable[[Workbench], Measurement]


def at_least(limit: float) -> Bounds:
    """A target from below."""
    return Bounds(at_least=limit)


def at_most(limit: float) -> Bounds:
    """A target from above."""
    return Bounds(at_most=limit)


def between(low: float, high: float) -> Bounds:
    """A target from both sides."""
    return Bounds(at_least=low, at_most=high)


def measured_lines(group: str, figures: Iterable[Figure], bench: Workbench) -> Iterator[dict[str, object]]:
    """One row a figure; one that cannot be measured has value None, the reason in `error`, and does not hold."""
    for figure in figures:
        target = None if figure.target is None else str(figure.target)
        row: dict[str, object] = {"figure": f"{group}: {figure.name}", "unit": figure.unit, "target": target}
        try:
            measurement = figure.measure(bench)
        except CommandFailed as error:
            yield row | {"value": None, "holds": False, "command": None, "error": str(error)}
            continue
        holds = None if figure.target is None else figure.target.hold(measurement.value)
        yield row | {"value": measurement.value, "holds": holds, "command": measurement.command}


def json_line(row: dict[str, object]) -> str:
    """A row as one line of JSON, its keys in the order they are promised in."""
    order = ("figure", "value", "unit", "target", "holds", "command", "error")
    return json.dumps({key: row[key] for key in order if key in row})
