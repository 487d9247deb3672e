"""What a stream does not hold any more, and why: ranges of numbers retained away or lost, recorded beside its files."""

import json
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from trigpoint.durable_files import replace_durably
from trigpoint.errors import LogDamaged

NAME = "absences.jsonl"  # in a stream's folder, one range a line, each with its checksum
LEDGER_LIMIT_BYTES = 256 * 1024 * 1024


class Reason(StrEnum):
    """Why events are not there."""

    RETAINED = "retained away"
    LOST = "lost"


@dataclass(frozen=True, slots=True)
class BootRanges:
    """Events of one boot of a source, as half-open ranges of their sequences."""

    source: str
    boot_id: str
    ranges: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Absence:
    """The numbers [first_number, stop_number) of a stream are not there. Of what was retained away, times in the
    closed range [start_ns, end_ns] and identities are known; of what was lost neither is."""

    first_number: int
    stop_number: int
    reason: Reason
    start_ns: int = 0
    end_ns: int = 0
    boots: tuple[BootRanges, ...] = ()

    @property
    def count(self) -> int:
        """How many events it is about."""
        return self.stop_number - self.first_number


def recorded_absences(folder: Path) -> tuple[Absence, ...]:
    """What a stream's folder says is not there, by number. Raises LogDamaged for a record that is not as written."""
    path = folder / NAME
    try:
        size_bytes = path.stat().st_size
        if size_bytes > LEDGER_LIMIT_BYTES:
            raise LogDamaged(f"{path}: {size_bytes} bytes, at most {LEDGER_LIMIT_BYTES} are read")
        lines = path.read_bytes().split(b"\n")
    except FileNotFoundError:
        return ()
    found = [_absence(path, number, line) for number, line in enumerate(lines[:-1], start=1)]
    if lines[-1]:
        raise LogDamaged(f"{path}, line {len(lines)}: does not end with a new line")
    return tuple(sorted(found, key=lambda absence: absence.first_number))


def record_absences(folder: Path, added: Iterable[Absence]) -> None:
    """More absences recorded, durably: all of them or none. Raises LogDamaged as reading does, OSError."""
    kept = (*recorded_absences(folder), *added)
    replace_durably(folder / NAME, b"".join(_line(absence) for absence in kept))


def uncovered(ranges: Sequence[tuple[int, int]], absences: Sequence[Absence]) -> tuple[tuple[int, int], ...]:
    """The parts of half-open ranges of numbers that no absence, given by number, accounts for."""
    left: list[tuple[int, int]] = []
    for first, stop in ranges:
        for absence in absences:
            if absence.first_number >= stop or absence.stop_number <= first:
                continue
            if absence.first_number > first:
                left.append((first, absence.first_number))
            first = min(stop, absence.stop_number)
        if first < stop:
            left.append((first, stop))
    return tuple(left)


def _line(absence: Absence) -> bytes:
    values = {
        "first_number": absence.first_number,
        "stop_number": absence.stop_number,
        "reason": absence.reason.value,
        "start_ns": absence.start_ns,
        "end_ns": absence.end_ns,
        "boots": [[boot.source, boot.boot_id, [list(span) for span in boot.ranges]] for boot in absence.boots],
    }
    return json.dumps({**values, "checksum": _checksum(values)}, ensure_ascii=False).encode() + b"\n"


def _checksum(values: Mapping[str, Any]) -> str:
    text = json.dumps(values, sort_keys=True)
    return f"{zlib.crc32(text.encode()):08x}"


def _absence(path: Path, number: int, line: bytes) -> Absence:
    try:
        values: dict[str, Any] = json.loads(line)
        said = values.pop("checksum")
        absence = Absence(
            first_number=values["first_number"],
            stop_number=values["stop_number"],
            reason=Reason(values["reason"]),
            start_ns=values["start_ns"],
            end_ns=values["end_ns"],
            boots=tuple(
                BootRanges(source, boot_id, tuple((start, stop) for start, stop in ranges))
                for source, boot_id, ranges in values["boots"]
            ),
        )
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise LogDamaged(f"{path}, line {number}: no record of an absence: {error}") from error
    if said != _checksum(values) or line + b"\n" != _line(absence):
        raise LogDamaged(f"{path}, line {number}: has checksum {_checksum(values)}, says {said}")
    return absence
