"""What a command says: lines for a person, or exactly one JSON object; progress on standard error."""

import functools
import json
import math
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from datetime import UTC, datetime
from typing import Any, Protocol

import click
import numpy as np
from tqdm import tqdm

from trigpoint.errors import InputError

JsonObject = dict[str, Any]

NS_PER_S = 1e9
FRACTION_STEPS = 1000
LIVE_S, WRITTEN_S = 0.2, 2.0  # between two states of a bar, on a terminal and in a file


@dataclass(frozen=True, slots=True)
class Answer:
    """What came of a command: its JSON object, the same as lines, and what was refused on the way."""

    values: JsonObject
    lines: tuple[str, ...] = ()
    complaints: tuple[str, ...] = ()


class CommandIncomplete(InputError):
    """The command did what it could and part of its input was refused; `answer` is what it did."""

    def __init__(self, complaints: tuple[str, ...], answer: JsonObject) -> None:
        more = f" (and {len(complaints) - 1} more, above)" if len(complaints) > 1 else ""
        super().__init__(f"{complaints[0]}{more}")
        self.answer = answer


class PartDone(Protocol):
    """Hears how much is done."""

    def __call__(self, done: int, total: int) -> None:
        """`done` of `total` are done."""


class Screen:
    """Where progress shows: standard error, except that `--json` into a file keeps it silent."""

    def __init__(self, *, as_json: bool) -> None:
        self._silent = as_json and not sys.stderr.isatty()

    @contextmanager
    def counting(self, what: str, *, total: int | None = None, unit: str = "") -> Iterator[Callable[[int], None]]:
        """A bar that hears how many more are done."""
        with self._bar(what, total=total, unit=f" {unit}" if unit else "it", unit_scale=True) as bar:

            def heard(count: int) -> None:
                bar.update(count)

            yield heard

    @contextmanager
    def part_of(self, what: str) -> Iterator[PartDone]:
        """A bar that hears how many are done, of how many."""
        with self._bar(what, unit_scale=True) as bar:

            def heard(done: int, total: int) -> None:
                bar.total = total
                bar.update(done - bar.n)

            yield heard

    @contextmanager
    def stages(self, what: str) -> Iterator[Callable[[str, float], None]]:
        """A bar that hears a stage's name and the share, 0 to 1, that is done of it."""
        form = "{l_bar}{bar}| {elapsed}"
        with self._bar(what, total=FRACTION_STEPS, bar_format=form) as bar:

            def heard(stage: str, share: float) -> None:
                bar.set_description_str(f"{what}: {stage}", refresh=False)
                bar.n = round(share * FRACTION_STEPS)
                bar.refresh()

            yield heard

    def _bar(self, what: str, **options: Any) -> "tqdm[Any]":
        interval_s = LIVE_S if sys.stderr.isatty() else WRITTEN_S
        return tqdm(desc=what, file=sys.stderr, disable=self._silent, mininterval=interval_s, **options)

    def note(self, line: str) -> None:
        """A line on standard error."""
        if not self._silent:
            click.echo(line, err=True)


def answering(function: Callable[..., Answer]) -> Callable[..., None]:
    """A command that says its answer: adds `--json`, the duration, and the exit status of what was refused.

    The function gets `screen`, where it shows progress.
    """

    @click.option("--json", "as_json", is_flag=True, help="One JSON object on standard output.")
    @functools.wraps(function)
    def command(*arguments: Any, as_json: bool, **options: Any) -> None:
        began_s = time.perf_counter()
        answer = function(*arguments, screen=Screen(as_json=as_json), **options)
        values = {**answer.values, "wall_s": round(time.perf_counter() - began_s, 3)}
        for complaint in answer.complaints[1:]:
            click.echo(f"trigpoint: {complaint}", err=True)
        if not as_json:
            for line in answer.lines:
                click.echo(line)
        if answer.complaints:
            raise CommandIncomplete(answer.complaints, plain(values))
        if as_json:
            click.echo(json.dumps(plain(values), allow_nan=False))

    return command


def plain(value: Any) -> Any:
    """The value as JSON can hold it: dataclasses as objects, NaN and infinity as null."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, str | int | bool) or value is None else str(value)


def utc(stamp_ns: int) -> str:
    """A time as people read it, to the second."""
    return datetime.fromtimestamp(stamp_ns / NS_PER_S, tz=UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def counted(count: int, what: str) -> str:
    """So many of something whose plural ends in s."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def metres(value: float) -> str:
    """A length as people read it."""
    return "unknown" if not math.isfinite(value) else f"{value:.3g} m" if value < 100.0 else f"{value:.0f} m"
