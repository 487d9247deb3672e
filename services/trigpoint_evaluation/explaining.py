"""Gathers what stands behind a landmark, from the database and the log; of the log only where it can be."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from typing import cast

from trigpoint.errors import InputError
from trigpoint.events.corrected import AnchorLabelled, Corrected
from trigpoint.events.envelope import LogPosition
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.mapped import AnchorAssociated, ImageOffsetSolved, Mapped, MapSolved, TrajectorySolved
from trigpoint.events.names import nearest_names
from trigpoint.events.observed import LandmarksDetected, VehicleDescribed
from trigpoint.events.perceived import LandmarksPerceived, LoopClosed
from trigpoint.landmarks.model import Landmark, MapVersion, valid_at
from trigpoint.landmarks.ports import LandmarkStore
from trigpoint.landmarks.queries import Disc, LandmarkQuery, require_known_version
from trigpoint.logs.as_of import LogAsOf
from trigpoint.logs.perceived_readings import PERCEIVED_STREAM, closed_loops, detected_in
from trigpoint.logs.ports import EventLog, LoggedBoot, LoggedEvent
from trigpoint_evaluation.core.explanation import (
    AnchorName,
    DriveName,
    Explanation,
    LoggedLoop,
    Sighting,
    TiedAnchor,
    corrections_behind,
    detection_of,
    moves_of,
    rows_behind,
    sensor_pose,
    sweeps_of,
)
from trigpoint_evaluation.core.loop_ties import loops_behind

MAP_STREAM = STREAM_PATTERNS[MapSolved]
LABEL_STREAM = STREAM_PATTERNS[AnchorLabelled]
PARTS = (AnchorAssociated, ImageOffsetSolved, MapSolved, TrajectorySolved)
NEARBY_M = 2.0  # where a landmark of another name may be the same pole: seen first by another drive


@dataclass(slots=True)
class _Parts:
    """What a version and those it is based on say of a landmark, the newest of each."""

    paths: dict[DriveName, TrajectorySolved] = field(default_factory=dict)
    tied: dict[AnchorName, tuple[AnchorAssociated, LogPosition]] = field(default_factory=dict)
    offsets: dict[str, ImageOffsetSolved] = field(default_factory=dict)


def explained(log: EventLog, store: LandmarkStore, landmark: str, *, as_of: int | None = None) -> Explanation:
    """Everything behind a landmark of a map version (None: the newest).

    Raises InputError for an unknown version, and for a landmark that is not in it, naming those most like it or the
    versions it is in; LogDamaged where the log cannot be read.
    """
    versions, history = store.map_versions(), store.history(landmark)
    known = [version.map_version for version in versions]
    map_version = (known or [0])[-1] if as_of is None else as_of
    require_known_version(map_version, known)
    row = next((row for row in history if valid_at(row, map_version)), None)
    if row is None:
        raise InputError(_absence(store, landmark, history, map_version))
    before = tuple(one for one in history if one.valid_from_version <= map_version)
    parts = _parts_of(log, versions, row, map_version)
    whole = _whole_below(versions, map_version)
    seen_by = sweeps_of(rows_behind(history, whole=whole.map_version, map_version=map_version))
    sightings = tuple(
        sighting for drive, sweeps in seen_by.items() for sighting in _seen(log, row, drive, sweeps, parts)
    )
    return Explanation(
        landmark=row,
        map_version=map_version,
        sightings=tuple(sorted(sightings, key=lambda one: (one.stamp_ns, one.vehicle))),
        missing=sum(map(len, seen_by.values())) - len(sightings),
        anchors=tuple(_tied_anchor(event, position, parts) for event, position in parts.tied.values()),
        loops=loops_behind(_loops(log, whole, parts), sightings, parts.paths),
        corrections=corrections_behind(
            _corrections(log),
            anchors=_anchors_ever(log, versions, before, parts),
            drives=set(sweeps_of(before)),
            read=_read_corrections(versions, map_version),
        ),
        moves=moves_of(before),
    )


def _absence(store: LandmarkStore, landmark: str, history: Sequence[Landmark], map_version: int) -> str:
    """Why a landmark is not in a version."""
    if not history:
        there = nearest_names(landmark, (row.landmark for row in store.landmarks(LandmarkQuery(as_of=map_version))))
        return f"landmark {landmark!r}: the map never had one of that name; version {map_version} has {there}"
    spans = ", ".join(
        f"{row.valid_from_version} to {'today' if row.valid_to_version is None else row.valid_to_version - 1}"
        for row in history
    )
    last = history[-1]
    place = Disc(lat_deg=last.lat_deg, lon_deg=last.lon_deg, radius_m=NEARBY_M)
    near = store.landmarks(LandmarkQuery(near=place, as_of=map_version, limit=1))
    instead = f"; within {NEARBY_M:g} m of it there stands {near[0].landmark!r}" if near else ""
    return f"landmark {landmark!r} is not in map version {map_version}, it is in versions {spans}{instead}"


def _parts_of(log: EventLog, versions: Sequence[MapVersion], row: Landmark, map_version: int) -> _Parts:
    """The paths and associations behind a row. Versions that say only what changed have no paths of what was driven
    since: that of the next whole one tells as well which of a sweep's detections is the landmark."""
    parts, whole = _Parts(), _whole_below(versions, map_version)
    at = next(version for version in versions if version.map_version == map_version)
    for logged in _rows_between(log, versions, whole, at):
        _take(parts, logged, row.landmark)
    following = (one for one in versions if one.map_version > map_version and not one.base_version)
    later = next(following, None) if at.base_version else None
    if later is not None:
        for logged in _rows_between(log, versions, later, later, kinds=(MapSolved, TrajectorySolved)):
            _take(parts, logged, row.landmark)
    return parts


def _whole_below(versions: Sequence[MapVersion], map_version: int) -> MapVersion:
    """The version that one is based on in the end: itself, if it is upon no other."""
    by_number = {version.map_version: version for version in versions}
    whole = by_number[map_version]
    while whole.base_version in by_number:
        whole = by_number[whole.base_version]
    return whole


def _rows_between(
    log: EventLog,
    versions: Sequence[MapVersion],
    first: MapVersion,
    last: MapVersion,
    *,
    kinds: Sequence[type] = PARTS,
) -> Iterable[LoggedEvent]:
    """The events of the versions from the first to the last, but for their landmarks: those that the writer of a
    version's MapSolved wrote for it."""
    number = max((one.log_number + 1 for one in versions if one.log_number < first.log_number), default=0)
    read = log.read(first.log_stream, first_number=number, kinds=kinds)
    rows = list(takewhile(lambda row: row.position.number <= last.log_number, read))
    known = {version.log_number for version in versions}
    closed = {_version_of(row) for row in rows if row.position.number in known}
    return (row for row in rows if _version_of(row) in closed)


def _version_of(row: LoggedEvent) -> tuple[str, str, int]:
    """The writer, its boot and the number of the version it wrote the event for."""
    identity, event = row.envelope.identity, cast(Mapped, row.envelope.event)
    return identity.source, identity.boot_id, event.map_version


def _take(parts: _Parts, row: LoggedEvent, landmark: str) -> None:
    """What a row says of the landmark, in place of what was said before."""
    event = row.envelope.event
    if isinstance(event, TrajectorySolved):
        parts.paths[event.vehicle, event.boot_id] = event
    elif isinstance(event, ImageOffsetSolved):
        parts.offsets[event.image] = event
    elif isinstance(event, AnchorAssociated) and event.landmark == landmark:
        parts.tied[event.anchor, event.image] = event, row.position
    elif isinstance(event, AnchorAssociated):
        parts.tied.pop((event.anchor, event.image), None)


def _seen(log: EventLog, row: Landmark, drive: DriveName, sweeps: Sequence[int], parts: _Parts) -> list[Sighting]:
    """The sweeps of one drive that saw the landmark: read only from the time it was seen in."""
    vehicle, boot_id = drive
    stream = STREAM_PATTERNS[LandmarksDetected].format(vehicle=vehicle)
    boot = next((one for one in log.boots(stream) if (one.source, one.boot_id) == drive), None)
    if boot is None:
        return []
    described = _described(log, stream, boot)
    from_ns, until_ns = max(row.first_seen_ns, boot.start_ns), min(row.last_seen_ns, boot.end_ns) + 1
    wanted = set(sweeps)
    detected = (
        _Swept(logged, logged.envelope.identity.sequence, cast(LandmarksDetected, logged.envelope.event))
        for logged in log.read(stream, from_ns=from_ns, until_ns=until_ns, kinds=(LandmarksDetected,))
        if logged.envelope.identity.boot_id == boot_id
    )
    perceived = (
        _Swept(logged, event.sweep_sequence, detected_in(event, described))
        for logged in log.read(PERCEIVED_STREAM, from_ns=from_ns, until_ns=until_ns, kinds=(LandmarksPerceived,))
        if ((event := cast(LandmarksPerceived, logged.envelope.event)).vehicle, event.boot_id) == drive
    )
    path = parts.paths.get(drive)
    last = {swept.sequence: swept for swept in (*detected, *perceived) if swept.sequence in wanted}
    return [_sighting(swept, row, path, drive, described) for swept in last.values()]


@dataclass(frozen=True, slots=True)
class _Swept:
    """What was detected in a sweep, and the event that says so."""

    logged: LoggedEvent
    sequence: int
    detected: LandmarksDetected


def _described(log: EventLog, stream: str, boot: LoggedBoot) -> VehicleDescribed:
    """What the vehicle said of itself in this boot last."""
    said = VehicleDescribed(vehicle=boot.source)
    for logged in log.read(stream, from_ns=boot.start_ns, until_ns=boot.end_ns + 1, kinds=(VehicleDescribed,)):
        if logged.envelope.identity.boot_id == boot.boot_id:
            said = cast(VehicleDescribed, logged.envelope.event)
    return said


def _sighting(
    swept: _Swept, row: Landmark, path: TrajectorySolved | None, drive: DriveName, described: VehicleDescribed
) -> Sighting:
    stamp_ns = swept.logged.envelope.stamp_ns
    seen, off_m = detection_of(row, swept.detected.detections, sensor_pose(path, described, stamp_ns))
    return Sighting(
        vehicle=drive[0],
        boot_id=drive[1],
        sequence=swept.sequence,
        stamp_ns=stamp_ns,
        position=swept.logged.position,
        range_m=None if seen is None else seen.range_m,
        bearing_rad=None if seen is None else seen.bearing_rad,
        off_m=off_m,
    )


def _tied_anchor(event: AnchorAssociated, position: LogPosition, parts: _Parts) -> TiedAnchor:
    offset = parts.offsets.get(event.image)
    return TiedAnchor(
        anchor=event.anchor,
        image=event.image,
        reason=event.reason,
        residual_m=(float(event.residual_m[0]), float(event.residual_m[1])),
        offset_m=None if offset is None else (float(offset.offset_m[0]), float(offset.offset_m[1])),
        map_version=event.map_version,
        position=position,
    )


def _loops(log: EventLog, whole: MapVersion, parts: _Parts) -> Iterable[LoggedLoop]:
    """The loops that a version solved whole was solved with, of drives that have paths."""
    then = LogAsOf(log, cast(list[tuple[str, int]], json.loads(whole.inputs_json)))
    for rows in closed_loops(then, parts.paths.keys()).values():
        for row in rows:
            event = cast(LoopClosed, row.envelope.event)
            yield LoggedLoop(position=row.position, stamp_ns=row.envelope.stamp_ns, event=event)


def _anchors_ever(
    log: EventLog, versions: Sequence[MapVersion], history: Sequence[Landmark], parts: _Parts
) -> set[AnchorName]:
    """The anchors tied to the landmark in any of these rows: as associated then."""
    tied, looked_for = set(parts.tied), {anchor for anchor, _ in parts.tied}
    for row in history:
        if not looked_for >= set(row.anchors):
            tied |= set(_parts_of(log, versions, row, row.valid_from_version).tied)
            looked_for |= set(row.anchors)
    return tied


def _corrections(log: EventLog) -> Iterable[tuple[LogPosition, int, Corrected]]:
    for row in log.read(LABEL_STREAM):
        yield row.position, row.envelope.stamp_ns, cast(Corrected, row.envelope.event)


def _read_corrections(versions: Sequence[MapVersion], map_version: int) -> int:
    """How many corrections a version was solved from."""
    inputs = next(version.inputs_json for version in versions if version.map_version == map_version)
    return dict(cast(list[tuple[str, int]], json.loads(inputs))).get(LABEL_STREAM, 0)
