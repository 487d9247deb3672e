"""Two landmark databases held against one another, row by row and exactly."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields

from trigpoint.landmarks.model import (
    Anchor,
    Checkpoint,
    ImageOffset,
    LabelGain,
    Landmark,
    MapRow,
    MapVersion,
    Trajectory,
)

RowKey = tuple[str, str]


@dataclass(frozen=True, slots=True)
class RowDifference:
    """One row that is not the same in both: its table, its key and what differs."""

    table: str
    key: str
    detail: str


def differences(held: Iterable[MapRow], replayed: Iterable[MapRow]) -> tuple[RowDifference, ...]:
    """All rows that differ between a database and what the log makes of it, in order of table and key."""
    held_rows, replayed_rows = _by_key(held), _by_key(replayed)
    found = (_difference(key, held_rows, replayed_rows) for key in sorted(held_rows.keys() | replayed_rows.keys()))
    return tuple(difference for difference in found if difference is not None)


def checkpoint_differences(held: Checkpoint, replayed: Checkpoint) -> tuple[RowDifference, ...]:
    """The streams that a database has not taken in as far as the log goes, or further."""
    streams = sorted({stream for stream, _ in held.next_numbers + replayed.next_numbers})
    pairs = [(stream, held.next_number(stream), replayed.next_number(stream)) for stream in streams]
    return tuple(
        RowDifference("log_checkpoints", stream, f"next_number {ours} instead of {theirs}")
        for stream, ours, theirs in pairs
        if ours != theirs
    )


def _difference(key: RowKey, held: Mapping[RowKey, MapRow], replayed: Mapping[RowKey, MapRow]) -> RowDifference | None:
    ours, theirs = held.get(key), replayed.get(key)
    if ours is None:
        return RowDifference(*key, "missing in the database")
    if theirs is None:
        return RowDifference(*key, "not in the log")
    if ours == theirs:
        return None
    named = [name for name in _columns(ours) if getattr(ours, name) != getattr(theirs, name)]
    return RowDifference(*key, "; ".join(_said(name, getattr(ours, name), getattr(theirs, name)) for name in named))


def _columns(row: MapRow) -> tuple[str, ...]:
    return row._fields if isinstance(row, Landmark) else tuple(field.name for field in fields(row))


def _said(name: str, ours: object, theirs: object) -> str:
    if isinstance(ours, tuple) and isinstance(theirs, tuple):
        return f"{name} of {len(ours)} differs from that of {len(theirs)}"
    return f"{name} {ours!r} instead of {theirs!r}"


def _by_key(rows: Iterable[MapRow]) -> dict[RowKey, MapRow]:
    return {_key(row): row for row in rows}


def _key(row: MapRow) -> RowKey:
    match row:
        case MapVersion():
            return "map_versions", f"{row.map_version}"
        case Landmark():
            return "landmarks", f"{row.landmark} from version {row.valid_from_version}"
        case Trajectory():
            return "trajectories", f"{row.vehicle}/{row.boot_id} of version {row.map_version}"
        case Anchor():
            return "anchors", f"{row.anchor} in {row.image or 'the survey'} of version {row.map_version}"
        case ImageOffset():
            return "image_offsets", f"{row.image} of version {row.map_version}"
        case LabelGain():
            return "label_gains", f"{row.image or 'no image'} of version {row.map_version}"
