"""What is known to be true of drives and landmarks, for evaluation only: model and text form.

The text form is CSV with the columns `kind,name,stamp_ns,lat_deg,lon_deg,heading_rad,signature`:

- `pose`: name = vehicle; position of the base, heading counter-clockwise from grid east of the map's CRS
- `landmark`: name = landmark, stamp 0, heading nan, signature where one is known
- `label`: name = anchor, signature = the landmark it was read from, position of that landmark
- `fix`: name = vehicle; true position of the antenna at a fix, signature = the fix's state
"""

import csv
import io
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

COLUMNS = ("kind", "name", "stamp_ns", "lat_deg", "lon_deg", "heading_rad", "signature")
KINDS = ("pose", "landmark", "label", "fix")


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthPath:
    """A vehicle's true poses (n,), sorted by stamp: degrees, heading in rad from grid east of the map's CRS."""

    vehicle: str
    stamp_ns: Ints
    lat_deg: Floats
    lon_deg: Floats
    heading_rad: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthLandmark:
    """A landmark's true position; `signature` its known identity or empty."""

    landmark: str
    lat_deg: float
    lon_deg: float
    signature: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthLabel:
    """Which landmark an anchor was read from, and where that landmark truly is."""

    anchor: str
    landmark: str
    lat_deg: float
    lon_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthFixes:
    """A vehicle's true antenna positions (n,) at its fixes and each fix's state, e.g. "clear", "multipath"."""

    vehicle: str
    stamp_ns: Ints
    lat_deg: Floats
    lon_deg: Floats
    state: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """All that is known to be true of some drives; any part may be empty."""

    paths: tuple[TruthPath, ...] = ()
    landmarks: tuple[TruthLandmark, ...] = ()
    labels: tuple[TruthLabel, ...] = ()
    fixes: tuple[TruthFixes, ...] = ()


@dataclass(frozen=True, slots=True)
class _Row:
    kind: str
    name: str
    stamp_ns: int
    lat_deg: float
    lon_deg: float
    heading_rad: float
    signature: str


def _rows_of(truth: Truth) -> Iterator[_Row]:
    for path in truth.paths:
        known = _columns(path.stamp_ns, path.lat_deg, path.lon_deg, path.heading_rad)
        yield from (_Row("pose", path.vehicle, int(t), lat, lon, heading, "") for t, lat, lon, heading in known)
    for fixes in truth.fixes:
        rows = zip(_columns(fixes.stamp_ns, fixes.lat_deg, fixes.lon_deg), fixes.state, strict=True)
        yield from (_Row("fix", fixes.vehicle, int(t), lat, lon, math.nan, state) for (t, lat, lon), state in rows)
    for landmark in truth.landmarks:
        yield _Row("landmark", landmark.landmark, 0, landmark.lat_deg, landmark.lon_deg, math.nan, landmark.signature)
    for label in truth.labels:
        yield _Row("label", label.anchor, 0, label.lat_deg, label.lon_deg, math.nan, label.landmark)


def _columns(*columns: Ints | Floats) -> Iterator[tuple[float, ...]]:
    return zip(*(column.tolist() for column in columns), strict=True)


def truth_lines(truth: Truth) -> Iterator[str]:
    """The truth as CSV lines with their line ends, 11 decimals of a degree (about a micrometre)."""
    yield _line(COLUMNS)
    for row in _rows_of(truth):
        position = f"{row.lat_deg:.11f}", f"{row.lon_deg:.11f}", f"{row.heading_rad:.9f}"
        yield _line((row.kind, row.name, str(row.stamp_ns), *position, row.signature))


def _line(cells: Sequence[str]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue()


def _parsed_row(line_number: int, cells: list[str]) -> _Row:
    try:
        kind, name, stamp_ns, lat_deg, lon_deg, heading_rad, signature = cells
        row = _Row(kind, name, int(stamp_ns), float(lat_deg), float(lon_deg), float(heading_rad), signature)
    except ValueError as error:
        raise InputError(
            f"truth, line {line_number}: {','.join(cells)!r} is not {','.join(COLUMNS)}: {error}"
        ) from None
    if row.kind not in KINDS:
        raise InputError(f"truth, line {line_number}: kind {row.kind!r} is none of {', '.join(KINDS)}")
    return row


def _by_name(rows: list[_Row], kind: str) -> dict[str, list[_Row]]:
    groups: dict[str, list[_Row]] = {}
    for row in rows:
        if row.kind == kind:
            groups.setdefault(row.name, []).append(row)
    return {name: sorted(group, key=lambda row: row.stamp_ns) for name, group in sorted(groups.items())}


def _path(vehicle: str, rows: list[_Row]) -> TruthPath:
    return TruthPath(
        vehicle=vehicle,
        stamp_ns=np.array([row.stamp_ns for row in rows], dtype=np.int64),
        lat_deg=np.array([row.lat_deg for row in rows]),
        lon_deg=np.array([row.lon_deg for row in rows]),
        heading_rad=np.array([row.heading_rad for row in rows]),
    )


def _fixes(vehicle: str, rows: list[_Row]) -> TruthFixes:
    return TruthFixes(
        vehicle=vehicle,
        stamp_ns=np.array([row.stamp_ns for row in rows], dtype=np.int64),
        lat_deg=np.array([row.lat_deg for row in rows]),
        lon_deg=np.array([row.lon_deg for row in rows]),
        state=tuple(row.signature for row in rows),
    )


def truth_from_lines(lines: Iterable[str]) -> Truth:
    """The truth from CSV lines, paths sorted by vehicle and time. Raises InputError naming the line."""
    cells = csv.reader(lines)
    header = next(cells, [])
    if tuple(header) != COLUMNS:
        raise InputError(f"truth, line 1: the columns are {','.join(header)!r}, expected {','.join(COLUMNS)!r}")
    rows = [_parsed_row(cells.line_num, row) for row in cells]
    return Truth(
        paths=tuple(_path(name, group) for name, group in _by_name(rows, "pose").items()),
        fixes=tuple(_fixes(name, group) for name, group in _by_name(rows, "fix").items()),
        landmarks=tuple(
            TruthLandmark(landmark=row.name, lat_deg=row.lat_deg, lon_deg=row.lon_deg, signature=row.signature)
            for row in rows
            if row.kind == "landmark"
        ),
        labels=tuple(
            TruthLabel(anchor=row.name, landmark=row.signature, lat_deg=row.lat_deg, lon_deg=row.lon_deg)
            for row in rows
            if row.kind == "label"
        ),
    )
