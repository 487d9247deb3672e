"""What a fleet's run left: the streams of its log and the rows of its database, and how two runs differ.

How many versions of the map there were on the way, and when vehicles were told where they are, depends on the clock
of a run: of that only the order is held to account. Everything else is equal, to the last bit.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from command_runs.processes import Fleet
from trigpoint.events.codec import Event, decode, encode
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.mapped import Mapped, MapSolved, OdometryCorrected
from trigpoint.landmarks.model import Landmark, MapRow, MapVersion
from trigpoint.landmarks.opening import geopackage_url, opened_store
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.readings import MAPPED_STREAM
from trigpoint_landmarks.app import replay_difference
from trigpoint_landmarks.core.comparison import RowDifference, differences

DATABASE = "landmarks.gpkg"
ODOMETRY_STREAM = STREAM_PATTERNS[OdometryCorrected]

Row = tuple[int, int, str, bytes]
"""Sequence, stamp in ns, schema and payload of an event."""
Boots = Mapping[tuple[str, str, str], tuple[Row, ...]]
"""The events of each stream, source and boot, in the order of the log."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """The log and the database of a run, and where the database differs from what a replay makes of the log."""

    boots: Boots
    rows: tuple[MapRow, ...]
    not_replayed: tuple[RowDifference, ...]


def outcome_of(fleet: Fleet) -> Outcome:
    """What a run left, after its processes ended; no rows where there is no database."""
    return outcome_in(fleet.data)


def outcome_in(data: Path) -> Outcome:
    """What a data directory holds."""
    path = data / DATABASE
    with closing(McapLog(data / "log")) as log:
        boots: dict[tuple[str, str, str], list[Row]] = {}
        for stream in log.streams():
            for logged in log.read(stream):
                identity, event = logged.envelope.identity, logged.envelope.event
                row = (identity.sequence, logged.envelope.stamp_ns, *encode(event))
                boots.setdefault((stream, identity.source, identity.boot_id), []).append(row)
        said = {key: tuple(found) for key, found in boots.items()}
        if not path.is_file():
            return Outcome(boots=said, rows=(), not_replayed=())
        with closing(opened_store(geopackage_url(path), read_only=True)) as store:
            return Outcome(boots=said, rows=tuple(store.rows()), not_replayed=replay_difference(log, store))


def stream_differences(ours: Outcome, theirs: Outcome, *, streams: tuple[str, ...] | None = None) -> list[str]:
    """The boots whose events are not the same, byte for byte and in the same order."""
    keys = sorted(ours.boots.keys() | theirs.boots.keys())
    chosen = [key for key in keys if streams is None or key[0] in streams]
    return [
        f"{'/'.join(key)}: {len(ours.boots.get(key, ()))} events, and {len(theirs.boots.get(key, ()))}"
        for key in chosen
        if ours.boots.get(key) != theirs.boots.get(key)
    ]


def final_differences(ours: Outcome, theirs: Outcome) -> list[str]:
    """Everything that must be the same in the end and is not, and what is amiss in ours on the way there."""
    return [
        *doubled(ours),
        *version_faults(ours),
        *stream_differences(ours, theirs, streams=("filtering",)),
        *final_map_differences(ours, theirs),
        *replayed_differences(ours),
        *row_differences_of_newest_maps(ours, theirs),
    ]


def doubled(outcome: Outcome) -> list[str]:
    """The boots that hold an event twice."""
    return ["/".join(key) for key, rows in outcome.boots.items() if len({row[0] for row in rows}) < len(rows)]


def events_by_boot(outcome: Outcome, stream: str) -> Iterator[list[tuple[int, Event]]]:
    """Stamp in ns and event of everything in a stream, boot by boot in the order they began."""
    for (name, _, _), rows in outcome.boots.items():
        if name == stream:
            yield [(stamp_ns, decode(schema, payload)) for _, stamp_ns, schema, payload in rows]


def version_faults(outcome: Outcome) -> list[str]:
    """Where the versions of the map are not one after the other, each whole in itself or upon the one before, of which
    it then has all that was read."""
    found: list[str] = []
    before, read = 0, dict[str, int]()
    for rows in events_by_boot(outcome, MAPPED_STREAM):
        for head in (event for _, event in rows if isinstance(event, MapSolved)):
            if head.map_version != before + 1 or head.base_version not in (0, before):
                found.append(f"version {head.map_version} upon {head.base_version} after version {before}")
            inputs = dict(head.inputs)
            if head.base_version:
                found += [f"version {head.map_version}: {name} is back" for name in read if inputs[name] < read[name]]
            before, read = head.map_version, inputs
    return found


def correction_differences(ours: Outcome, theirs: Outcome) -> list[str]:
    """Where a drive was told its place of a time no later than it was told before, and the vehicles that were not told
    of the same time last."""
    found, newest = _corrections(ours)
    _, other = _corrections(theirs)
    alone = newest.items() ^ other.items()
    return [*found, *(f"{vehicle}: told of {stamp_ns} ns last" for vehicle, stamp_ns in alone)]


def _corrections(outcome: Outcome) -> tuple[list[str], dict[str, int]]:
    """What is out of order, and by vehicle the newest time in ns it was told its place of."""
    found, told = [], dict[tuple[str, str], int]()
    for rows in events_by_boot(outcome, ODOMETRY_STREAM):
        for stamp_ns, event in rows:
            if isinstance(event, OdometryCorrected):
                drive = (event.vehicle, event.boot_id)
                if stamp_ns <= told.get(drive, -1):
                    found.append(f"{drive}: {stamp_ns} ns after {told[drive]} ns")
                told[drive] = stamp_ns
    newest: dict[str, int] = {}
    for (vehicle, _), stamp_ns in told.items():
        newest[vehicle] = max(newest.get(vehicle, 0), stamp_ns)
    return found, newest


def final_map(outcome: Outcome) -> Counter[tuple[str, bytes]]:
    """The events of the newest version of the map, but for its number and how long the solve took."""
    *_, newest = events_by_boot(outcome, MAPPED_STREAM)
    unnumbered = [replace(event, map_version=0) for _, event in newest if isinstance(event, Mapped)]
    return Counter(
        encode(replace(event, wall_s=0.0) if isinstance(event, MapSolved) else event) for event in unnumbered
    )


def final_map_differences(ours: Outcome, theirs: Outcome) -> list[str]:
    """The events of the newest map that are in one of the two alone."""
    held, other = final_map(ours), final_map(theirs)
    return [schema for schema, _ in ((held - other) + (other - held)).elements()]


def replayed_differences(outcome: Outcome) -> list[str]:
    """The rows of the database, of every version, that are not what a replay of the log makes them."""
    return [str(one) for one in outcome.not_replayed]


def row_differences_of_newest_maps(ours: Outcome, theirs: Outcome) -> list[str]:
    """The rows of the newest maps that are not the same, but for the numbers of the versions."""
    held, other = (newest_map(outcome.rows) for outcome in (ours, theirs))
    return [str(one) for one in differences(held, other)]


def newest_map(rows: tuple[MapRow, ...]) -> list[MapRow]:
    """The rows of the newest version, as if it were version 0, solved in no time and logged at the beginning."""
    newest = max((row.map_version for row in rows if isinstance(row, MapVersion)), default=0)
    found: list[MapRow] = []
    for row in rows:
        if isinstance(row, Landmark):
            found += [valid_from_0(row)] if row.valid_to_version is None else []
        elif isinstance(row, MapVersion) and row.map_version == newest:
            found.append(replace(row, map_version=0, wall_s=0.0, log_number=0))
        elif row.map_version == newest:
            found.append(replace(row, map_version=0))
    return found


def valid_from_0(row: Landmark) -> Landmark:
    """The same landmark, valid from version 0 on."""
    return Landmark(**{name: getattr(row, name) for name in Landmark.__annotations__} | {"valid_from_version": 0})
