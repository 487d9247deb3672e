"""Corrections into the log: anchors taken back, drives left out of the map and let in again."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from trigpoint.errors import InputError
from trigpoint.events.codec import encode
from trigpoint.events.corrected import AnchorRetracted, Corrected, DriveExcluded, DriveIncluded
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.names import nearest_names
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import logged_corrections, vehicle_streams
from trigpoint_ingest.anchors import CORRECTIONS_STREAM
from trigpoint_ingest.core.anchors import content_name
from trigpoint_ingest.core.limits import TEXT_LIMIT
from trigpoint_ingest.core.standing import AnchorStanding, DriveStanding, anchor_standings, drive_corrections

CORRECTING_SOURCE = "corrections"


@dataclass(frozen=True, slots=True, kw_only=True)
class Attribution:
    """Who corrects, when and why. Raises InputError for nobody, and for a text over TEXT_LIMIT characters."""

    author: str
    reason: str
    stamp_ns: int

    def __post_init__(self) -> None:
        if not self.author.strip():
            raise InputError(f"author {self.author!r}: a correction needs somebody who says so")
        for name, text in (("author", self.author), ("reason", self.reason)):
            if len(text) > TEXT_LIMIT:
                raise InputError(f"{name} of {len(text)} characters, limit {TEXT_LIMIT}")


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectionReport:
    """`appended` corrections are new in the log, from `first_number` of the corrections' stream on; `known` of those
    asked for stood like that already."""

    appended: tuple[Corrected, ...]
    known: int
    first_number: int


def logged_anchor_standings(log: EventLog) -> tuple[AnchorStanding, ...]:
    """Every anchor ever labelled, and whether it holds."""
    return anchor_standings(logged_corrections(log))


def logged_drive_standings(log: EventLog) -> tuple[DriveStanding, ...]:
    """Every drive in the log in order of vehicle and time, and whether the map is solved with it."""
    corrected = drive_corrections(logged_corrections(log))
    return tuple(
        DriveStanding(
            vehicle=boot.source,
            boot_id=boot.boot_id,
            start_ns=boot.start_ns,
            end_ns=boot.end_ns,
            corrected=corrected.get((boot.source, boot.boot_id)),
        )
        for stream in vehicle_streams(log)
        for boot in log.boots(stream)
    )


def retract_anchor(log: EventLog, anchor: str, *, image: str | None, by: Attribution) -> CorrectionReport:
    """The anchor of this name retracted; one retracted already stays so. `image` None: the only one it is in.

    Raises InputError for an anchor nobody labelled and for a name in several images, naming what there is.
    """
    standing = _anchor_named(logged_anchor_standings(log), anchor, image)
    retracted = AnchorRetracted(anchor=anchor, image=standing.label.image, author=by.author, reason=by.reason)
    return _appended(log, [] if standing.retracted else [retracted], asked=1, by=by)


def retract_anchors(log: EventLog, named: Sequence[tuple[str, str]], *, by: Attribution) -> CorrectionReport:
    """The anchors in force of these names and images retracted together."""
    events = [
        AnchorRetracted(anchor=anchor, image=image, author=by.author, reason=by.reason) for anchor, image in named
    ]
    return _appended(log, events, asked=len(events), by=by)


def exclude_drives(log: EventLog, vehicle: str, *, boot_id: str | None, by: Attribution) -> CorrectionReport:
    """The vehicle's drive of this boot (None: all it has driven) excluded; one that is already stays so.

    Raises InputError for a drive that is not in the log, naming those that are.
    """
    drives = _drives_named(logged_drive_standings(log), vehicle, boot_id)
    out = [_drive_event(DriveExcluded, drive, by) for drive in drives if not drive.excluded]
    return _appended(log, out, asked=len(drives), by=by)


def include_drives(log: EventLog, vehicle: str, *, boot_id: str | None, by: Attribution) -> CorrectionReport:
    """The vehicle's excluded drive of this boot (None: each excluded one) included; one that was already stays so.

    Raises InputError for a drive that is not in the log or was never excluded, naming those that are.
    """
    standings = logged_drive_standings(log)
    drives = [one for one in _drives_named(standings, vehicle, boot_id) if one.corrected is not None]
    if not drives:
        excluded = [f"{one.vehicle} {one.boot_id}" for one in standings if one.excluded]
        asked = vehicle if boot_id is None else f"{vehicle} {boot_id}"
        raise InputError(f"{asked!r}: no such drive was ever excluded; excluded are {nearest_names(asked, excluded)}")
    back = [_drive_event(DriveIncluded, drive, by) for drive in drives if drive.excluded]
    return _appended(log, back, asked=len(drives), by=by)


def _anchor_named(standings: Sequence[AnchorStanding], anchor: str, image: str | None) -> AnchorStanding:
    named = [one for one in standings if one.label.anchor == anchor]
    if not named:
        there = nearest_names(anchor, (one.label.anchor for one in standings))
        raise InputError(f"anchor {anchor!r}: nobody labelled one of that name; there are {there}")
    found = [one for one in named if image is None or one.label.image == image]
    if len(found) == 1:
        return found[0]
    images = nearest_names(image or "", (one.label.image for one in named))
    if not found:
        raise InputError(f"anchor {anchor!r} was not labelled in image {image!r}; it was in {images}")
    raise InputError(f"anchor {anchor!r} was labelled in {len(found)} images, {images}: say --image which one")


def _drives_named(standings: Sequence[DriveStanding], vehicle: str, boot_id: str | None) -> list[DriveStanding]:
    own = [one for one in standings if one.vehicle == vehicle]
    if not own:
        there = nearest_names(vehicle, (one.vehicle for one in standings))
        raise InputError(f"vehicle {vehicle!r} has no drive in the log; there are {there}")
    found = [one for one in own if boot_id is None or one.boot_id == boot_id]
    if not found:
        there = nearest_names(boot_id or "", (one.boot_id for one in own))
        raise InputError(f"vehicle {vehicle!r} has no boot {boot_id!r}; it has {there}")
    return found


def _drive_event(
    event_class: Callable[..., DriveExcluded | DriveIncluded], drive: DriveStanding, by: Attribution
) -> DriveExcluded | DriveIncluded:
    return event_class(vehicle=drive.vehicle, boot_id=drive.boot_id, author=by.author, reason=by.reason)


def _appended(log: EventLog, events: Sequence[Corrected], *, asked: int, by: Attribution) -> CorrectionReport:
    """The events at the end of the corrections. Raises AppendFailed."""
    number = log.next_number(CORRECTIONS_STREAM)
    if events:
        boot_id = content_name((encode(event)[1] for event in events), number=number)
        rows = [
            Envelope(EventIdentity(CORRECTING_SOURCE, boot_id, sequence), by.stamp_ns, event)
            for sequence, event in enumerate(events)
        ]
        log.append(CORRECTIONS_STREAM, rows)
    return CorrectionReport(appended=tuple(events), known=asked - len(events), first_number=number)
