"""What a log holds, folded into the values services work on: frame, drives, anchors, verdicts, map versions."""

from collections.abc import Callable
from typing import cast

from trigpoint.errors import InputError
from trigpoint.events.corrected import AnchorLabelled, Corrected, anchors_in_force, excluded_drives
from trigpoint.events.drives import DRIVE_KINDS, Drive, drives_of
from trigpoint.events.envelope import Envelope
from trigpoint.events.estimated import FixJudged
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.mapped import Mapped, MapSolved
from trigpoint.events.observed import MapFramePinned, Observed, VehicleDescribed
from trigpoint.events.solved import SolvedMap, closed_versions, solved_maps
from trigpoint.geodesy.positions import GridPosition
from trigpoint.geodesy.projection import MapFrame, pin_map_frame
from trigpoint.logs.perceived_readings import with_perceived
from trigpoint.logs.ports import EventLog

Progress = Callable[[int, int], None]

VEHICLE_PREFIX = STREAM_PATTERNS[VehicleDescribed].partition("{")[0]
FRAME_STREAM, MAPPED_STREAM = STREAM_PATTERNS[MapFramePinned], STREAM_PATTERNS[MapSolved]
LABEL_STREAM, VERDICT_STREAM = STREAM_PATTERNS[AnchorLabelled], STREAM_PATTERNS[FixJudged]
PROGRESS_COUNT = 5000  # events between two calls


def in_silence(done: int, total: int) -> None:
    """Progress for nobody."""


def pinned_frame(log: EventLog) -> MapFrame | None:
    """The map's frame, None before it was pinned."""
    for row in log.read(FRAME_STREAM, kinds=(MapFramePinned,)):
        event = cast(MapFramePinned, row.envelope.event)
        return pin_map_frame(crs=event.crs, origin=GridPosition(event.origin_easting_m, event.origin_northing_m))
    return None


def logged_frame(log: EventLog) -> MapFrame:
    """The map's pinned frame. Raises InputError where nothing has pinned one."""
    frame = pinned_frame(log)
    if frame is None:
        raise InputError("the log pins no map frame: it has no GNSS fix, no declared origin and no anchor")
    return frame


def vehicle_streams(log: EventLog) -> tuple[str, ...]:
    """The streams of vehicles' observations, sorted."""
    return tuple(filter(is_vehicle_stream, log.streams()))


def is_vehicle_stream(stream: str) -> bool:
    """Whether a stream is of a vehicle's observations."""
    return stream.startswith(VEHICLE_PREFIX)


def drives_of_vehicle(log: EventLog, vehicle: str) -> tuple[Drive, ...]:
    """A vehicle's drives, excluded ones too. Raises InputError where there is none, naming those that have some."""
    streams = vehicle_streams(log)
    if f"{VEHICLE_PREFIX}{vehicle}" not in streams:
        known = ", ".join(stream.removeprefix(VEHICLE_PREFIX) for stream in streams) or "none"
        raise InputError(f"vehicle {vehicle!r} has no drive in the log; these have: {known}")
    logged = log.read(f"{VEHICLE_PREFIX}{vehicle}", kinds=DRIVE_KINDS)
    rows = [cast(Envelope[Observed], row.envelope) for row in logged]
    return with_perceived(drives_of(rows), log)


def logged_drives(log: EventLog, *, progress: Progress = in_silence) -> tuple[Drive, ...]:
    """Every drive in the log that is not excluded, what was perceived in its sweeps among its detections.

    Raises InputError where there is none.
    """
    streams, excluded = vehicle_streams(log), excluded_drives(logged_corrections(log))
    total = sum(log.next_number(stream) for stream in streams)
    rows: list[Envelope[Observed]] = []
    for done, logged in enumerate((row for stream in streams for row in log.read(stream, kinds=DRIVE_KINDS)), start=1):
        identity = logged.envelope.identity
        if (identity.source, identity.boot_id) not in excluded:
            rows.append(cast(Envelope[Observed], logged.envelope))
        if done % PROGRESS_COUNT == 0:
            progress(done, total)
    if not rows:
        raise InputError(_without_drive(total, len(excluded)))
    progress(total, total)
    return with_perceived(drives_of(rows), log)


def _without_drive(total: int, excluded: int) -> str:
    if not total:
        return "the log holds no vehicle's events: nothing was ingested yet"
    if excluded:
        return f"all of the log's {excluded} drives are excluded; `trigpoint drives include` takes one back"
    return f"none of the log's {total} events of vehicles tells of a path: points alone make no drive"


def logged_corrections(log: EventLog) -> tuple[Corrected, ...]:
    """Everything people added or took back, in order of appending."""
    return tuple(cast(Corrected, row.envelope.event) for row in log.read(LABEL_STREAM))


def logged_anchors(log: EventLog) -> tuple[AnchorLabelled, ...]:
    """The anchors in force: of several labels of one name in one image the last, unless it was retracted since."""
    return anchors_in_force(logged_corrections(log))


def logged_verdicts(log: EventLog) -> tuple[FixJudged, ...]:
    """The filter's verdicts; of a fix judged twice the last one counts."""
    last: dict[tuple[str, str, int], FixJudged] = {}
    for row in log.read(VERDICT_STREAM, kinds=(FixJudged,)):
        verdict = cast(FixJudged, row.envelope.event)
        last[verdict.vehicle, verdict.boot_id, verdict.fix_sequence] = verdict
    return tuple(last.values())


def logged_maps(log: EventLog) -> tuple[SolvedMap, ...]:
    """Every complete map version, oldest first."""
    rows = (cast(Envelope[Mapped], row.envelope) for row in log.read(MAPPED_STREAM))
    return solved_maps(event for head, parts in closed_versions(rows) for event in (*parts, head))
