"""What a fleet's run left: the streams of its log and the rows of its database, and how two runs differ."""

from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from command_runs.processes import Fleet
from trigpoint.events.codec import encode
from trigpoint.landmarks.model import Landmark, MapRow, MapVersion
from trigpoint.landmarks.opening import geopackage_path, geopackage_url, opened_store
from trigpoint.logs.mcap_log import McapLog
from trigpoint_landmarks.core.comparison import differences

Row = tuple[int, int, str, bytes]
"""Sequence, stamp in ns, schema and payload of an event."""
Boots = Mapping[tuple[str, str, str], tuple[Row, ...]]
"""The events of each stream, source and boot, in the order of the log."""

WRITERS = {"filtering": ("filtering",), "optimisation": ("optimisation", "odometry")}


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """The log and the database of a run."""

    boots: Boots
    rows: tuple[MapRow, ...]


def outcome_of(fleet: Fleet, *, url: str | None = None, password_file: Path | None = None) -> Outcome:
    """What a run left, after its processes ended; no rows where there is no database."""
    with closing(McapLog(fleet.data / "log")) as log:
        boots: dict[tuple[str, str, str], list[Row]] = {}
        for stream in log.streams():
            for logged in log.read(stream):
                identity, event = logged.envelope.identity, logged.envelope.event
                row = (identity.sequence, logged.envelope.stamp_ns, *encode(event))
                boots.setdefault((stream, identity.source, identity.boot_id), []).append(row)
    rows = _rows(url or geopackage_url(fleet.data / "landmarks.gpkg"), password_file)
    return Outcome(boots={key: tuple(found) for key, found in boots.items()}, rows=rows)


def _rows(url: str, password_file: Path | None) -> tuple[MapRow, ...]:
    path = geopackage_path(url)
    if path is not None and not path.is_file():
        return ()
    with closing(opened_store(url, password_file=password_file, read_only=True)) as store:
        return tuple(store.rows())


def stream_differences(ours: Outcome, theirs: Outcome, *, streams: tuple[str, ...] | None = None) -> list[str]:
    """The boots whose events are not the same, byte for byte and in the same order."""
    keys = sorted(ours.boots.keys() | theirs.boots.keys())
    chosen = [key for key in keys if streams is None or key[0] in streams]
    return [
        f"{'/'.join(key)}: {len(ours.boots.get(key, ()))} events, and {len(theirs.boots.get(key, ()))}"
        for key in chosen
        if ours.boots.get(key) != theirs.boots.get(key)
    ]


def doubled(outcome: Outcome) -> list[str]:
    """The boots that hold an event twice."""
    return ["/".join(key) for key, rows in outcome.boots.items() if len({row[0] for row in rows}) < len(rows)]


def row_differences(ours: Outcome, theirs: Outcome) -> list[str]:
    """The rows of the database that are not the same."""
    return [f"{one.table} {one.key}: {one.detail}" for one in differences(ours.rows, theirs.rows)]


def map_differences(ours: Outcome, theirs: Outcome) -> list[str]:
    """Where the newest maps differ. How many versions came before, and when, depends on the clock of either run, so
    that numbers of versions and what is left of former ones are not looked at; every value of the map itself is."""
    held, other = (newest_map(outcome.rows) for outcome in (ours, theirs))
    return [f"{one.table} {one.key}: {one.detail}" for one in differences(held, other)]


def newest_map(rows: tuple[MapRow, ...]) -> list[MapRow]:
    """The landmarks, trajectories, anchors and image offsets of the newest version, as of version 0."""
    newest = max((row.map_version for row in rows if isinstance(row, MapVersion)), default=0)
    found: list[MapRow] = []
    for row in rows:
        if isinstance(row, Landmark):
            found += [replace(row, valid_from_version=0)] if row.valid_to_version is None else []
        elif not isinstance(row, MapVersion) and row.map_version == newest:
            found.append(replace(row, map_version=0))
    return found
