"""What a simulated world holds of the kinds perception finds, for evaluation only: model and text form.

The text form is CSV with the columns `kind,name,lat_deg,lon_deg,ground_m,height_m,radius_m`, one line an object.
"""

import csv
import io
from collections.abc import Iterable, Iterator
from dataclasses import astuple, dataclass, fields

from trigpoint.errors import InputError

KINDS = ("pole", "sign", "trunk", "corner")


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthObject:
    """An upright object: `kind` one of KINDS (a sign is a pole with a plate); where it stands; `ground_m` the ground's
    height there over the world's own level; `height_m` above that, of a trunk up to its crown; `radius_m` at its foot,
    NaN for a corner."""

    kind: str
    name: str
    lat_deg: float
    lon_deg: float
    ground_m: float
    height_m: float
    radius_m: float


COLUMNS = tuple(field.name for field in fields(TruthObject))
DECIMALS = (11, 11, 4, 4, 4)  # of a degree (about a micrometre), of a metre


def object_lines(objects: Iterable[TruthObject]) -> Iterator[str]:
    """The objects as CSV lines with their line ends."""
    yield ",".join(COLUMNS) + "\n"
    for one in objects:
        kind, name, *numbers = astuple(one)
        text = io.StringIO()
        told = (f"{number:.{decimals}f}" for number, decimals in zip(numbers, DECIMALS, strict=True))
        csv.writer(text, lineterminator="\n").writerow((kind, name, *told))
        yield text.getvalue()


def objects_from_lines(lines: Iterable[str]) -> tuple[TruthObject, ...]:
    """The objects from CSV lines. Raises InputError naming the line."""
    cells = csv.reader(lines)
    header = next(cells, [])
    if tuple(header) != COLUMNS:
        raise InputError(f"objects, line 1: the columns are {','.join(header)!r}, expected {','.join(COLUMNS)!r}")
    return tuple(_parsed(cells.line_num, row) for row in cells)


def _parsed(line_number: int, row: list[str]) -> TruthObject:
    try:
        kind, name, *numbers = row
        lat_deg, lon_deg, ground_m, height_m, radius_m = (float(number) for number in numbers)
    except ValueError as error:
        raise InputError(
            f"objects, line {line_number}: {','.join(row)!r} is not {','.join(COLUMNS)}: {error}"
        ) from None
    if kind not in KINDS:
        raise InputError(f"objects, line {line_number}: kind {kind!r} is none of {', '.join(KINDS)}")
    return TruthObject(
        kind=kind,
        name=name,
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        ground_m=ground_m,
        height_m=height_m,
        radius_m=radius_m,
    )
