"""Text files of rows and columns, read cell by cell with errors that name file, row and value."""

import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

WHITESPACE = "whitespace"
MISSING = frozenset({"", "nan", "na", "n/a", "null", "none"})  # cells without a measurement, in any case
EXACT_DIGITS = 15  # decimal digits float64 always keeps apart
PLAIN_CHARACTERS = frozenset("0123456789.-")
LIMITS_NS = (np.iinfo(np.int64).min, np.iinfo(np.int64).max)


@dataclass(frozen=True, slots=True)
class SourceText:
    """A file's name, as messages shall give it, and its text."""

    name: str
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TextTable:
    """A table of text cells: `cells[i]` are those of `columns[i]`, `line_number` says where each row stood."""

    source: str
    columns: tuple[str, ...]
    cells: tuple[tuple[str, ...], ...]
    line_number: tuple[int, ...]

    def texts(self, column: str) -> tuple[str, ...]:
        """The cells of a column. Raises InputError for an unknown one."""
        if column not in self.columns:
            raise InputError(f"{self.source}: no column {column!r}; there are {', '.join(self.columns)}")
        return self.cells[self.columns.index(column)]

    def numbers(self, column: str) -> Floats:
        """The numbers of a column (n,), NaN where a cell is empty or says so. Raises InputError for anything else."""
        texts = self.texts(column)
        try:
            numbers = np.array(texts, dtype=np.str_).astype(np.float64)
        except ValueError:
            numbers = np.array([self._number(row, column, text) for row, text in enumerate(texts)])
        infinite = np.flatnonzero(np.isinf(numbers))
        if len(infinite):
            raise self.refused(int(infinite[0]), column, "not a finite number")
        return numbers

    def stamps_ns(self, column: str, *, unit_ns: int, epoch_ns: int) -> Ints:
        """Stamps (n,): exact decimals of a column times `unit_ns`, from `epoch_ns`. Raises InputError."""
        texts = self.texts(column)
        exact = _exact_stamps_ns(texts, unit_ns)
        if exact is not None:
            return exact + epoch_ns
        stamps = (self._stamp_ns(row, column, text, unit_ns) + epoch_ns for row, text in enumerate(texts))
        return np.fromiter(stamps, dtype=np.int64)

    def refused(self, row: int, column: str, why: str) -> InputError:
        """The error that names a cell's file, row and value."""
        text = self.texts(column)[row]
        return InputError(f"{self.source}, row {self.line_number[row]}: {column} is {text!r}, {why}")

    def _number(self, row: int, column: str, text: str) -> float:
        try:
            return float(text)
        except ValueError:
            if text.lower() in MISSING:
                return math.nan
            raise self.refused(row, column, "not a number") from None

    def _stamp_ns(self, row: int, column: str, text: str, unit_ns: int) -> int:
        try:
            stamp_ns = round(Decimal(text.strip()) * unit_ns)
        except (InvalidOperation, ValueError, OverflowError):
            raise self.refused(row, column, "not a time") from None
        if not LIMITS_NS[0] // 2 <= stamp_ns <= LIMITS_NS[1] // 2:
            raise self.refused(row, column, "out of the range of 64-bit nanoseconds")
        return stamp_ns


def _exact_stamps_ns(texts: tuple[str, ...], unit_ns: int) -> Ints | None:
    # plain decimals short enough for float64 to hold every digit, and for int64 as nanoseconds; None for anything else
    decimals = max((len(text) - 1 - text.find(".") for text in texts if "." in text), default=0)
    digits = max((len(text) for text in texts), default=0)
    if digits > EXACT_DIGITS or unit_ns % 10**decimals or not set("".join(texts)) <= PLAIN_CHARACTERS:
        return None
    try:
        counts = np.rint(np.array(texts, dtype=np.str_).astype(np.float64) * 10.0**decimals)
    except ValueError:
        return None
    step_ns = unit_ns // 10**decimals
    if np.abs(counts).max(initial=0.0) * step_ns > LIMITS_NS[1] // 2:
        return None
    stamps: Ints = counts.astype(np.int64) * step_ns
    return stamps


def _split_rows(numbered: Sequence[tuple[int, str]], delimiter: str) -> Iterator[tuple[int, list[str]]]:
    """Cells of numbered lines, each row with the line it ends on: a cell in quotes may go over several."""
    if delimiter == WHITESPACE:
        return ((number, line.split()) for number, line in numbered)
    rows = csv.reader((line for _, line in numbered), delimiter=delimiter, skipinitialspace=True)
    return ((numbered[rows.line_num - 1][0], [cell.strip() for cell in row]) for row in rows)


def text_table(
    source: SourceText, *, columns: Sequence[str] = (), delimiter: str = ",", comment: str = "#"
) -> TextTable:
    """The table of a text; without `columns` its first row names them. Empty lines and comments are no rows.

    Raises InputError where there is no header, a name twice, a row of another length, or a cell too long.
    """
    lines = source.text.removeprefix("\ufeff").splitlines()
    numbered = [(number, line) for number, line in enumerate(lines, start=1) if line.strip()]
    if comment:
        numbered = [(number, line) for number, line in numbered if not line.lstrip().startswith(comment)]
    try:
        split = list(_split_rows(numbered, delimiter))
    except csv.Error as error:
        raise InputError(f"{source.name}: cannot be read as a table: {error}") from error
    line_number, rows = [number for number, _ in split], [row for _, row in split]
    names = tuple(columns)
    if not names:
        names, rows, line_number = _headed(source.name, rows), rows[1:], line_number[1:]
    if len(set(names)) < len(names):
        raise InputError(f"{source.name}: a column name stands twice in {', '.join(names)}")
    for number, row in zip(line_number, rows, strict=True):
        if len(row) != len(names):
            raise InputError(f"{source.name}, row {number}: {len(row)} cells, expected {len(names)}")
    cells = tuple(zip(*rows, strict=True)) if rows else ((),) * len(names)
    return TextTable(source=source.name, columns=names, cells=cells, line_number=tuple(line_number))


def _headed(name: str, rows: list[list[str]]) -> tuple[str, ...]:
    if not rows:
        raise InputError(f"{name}: no header row, the file has no rows at all")
    return tuple(rows[0])
