"""Filtering at work on a log: every drive in it filtered, what was not yet said of it appended."""

import logging
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import cast

from trigpoint.events.codec import Event
from trigpoint.events.drives import Drive, drives_of
from trigpoint.events.envelope import Envelope
from trigpoint.events.estimated import Estimated, FixJudged, PoseFiltered
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.observed import (
    GnssFixReceived,
    ImuMeasured,
    MapFramePinned,
    Observed,
    VehicleDescribed,
    WheelPairMeasured,
    WheelSpeedMeasured,
)
from trigpoint.geodesy.positions import GridPosition
from trigpoint.geodesy.projection import MapFrame, pin_map_frame
from trigpoint.logs.ports import EventLog
from trigpoint_filtering.core.publication import Published, output_boot_id, published
from trigpoint_filtering.core.track import begun_track, tracks
from trigpoint_filtering.settings import FilterSettings

STREAM = STREAM_PATTERNS[FixJudged]
FRAME_STREAM = STREAM_PATTERNS[MapFramePinned]
VEHICLE_STREAM_PREFIX = STREAM_PATTERNS[VehicleDescribed].partition("{")[0]
KINDS = (VehicleDescribed, WheelSpeedMeasured, WheelPairMeasured, ImuMeasured, GnssFixReceived)

Progress = Callable[[int, int], None]

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveReport:
    """What became of a drive: fixes accepted and rejected, events appended now, and why it has no pose, if so."""

    vehicle: str
    boot_id: str
    accepted: int
    rejected: int
    appended: int
    refusal: str


def filter_log(
    log: EventLog, settings: FilterSettings | None = None, *, progress: Progress | None = None
) -> tuple[DriveReport, ...]:
    """Every drive of the log filtered, its verdicts, poses and alarms appended; again: nothing is appended twice.

    A drive that cannot be filtered is reported with the reason, and the others go on. Raises AppendFailed.
    """
    chosen, frame, said = settings or FilterSettings(), logged_frame(log), said_counts(log)
    if frame is None:
        logger.warning("nothing filtered: no map frame is pinned in stream %r", FRAME_STREAM)
        return ()
    return tuple(
        _filtered(
            log, drive, frame, chosen, said[output_boot_id(drive.vehicle, drive.boot_id, frame, chosen)], progress
        )
        for drive in logged_drives(log)
    )


def logged_frame(log: EventLog) -> MapFrame | None:
    """The map's frame as the log has it, None before it was pinned."""
    for logged in log.read(FRAME_STREAM, kinds=(MapFramePinned,)):
        pinned = cast(MapFramePinned, logged.envelope.event)
        return pin_map_frame(crs=pinned.crs, origin=GridPosition(pinned.origin_easting_m, pinned.origin_northing_m))
    return None


def logged_drives(log: EventLog) -> Iterator[Drive]:
    """The drives in the log, one vehicle's after the other's, without their landmark detections."""
    for stream in log.streams():
        if stream.startswith(VEHICLE_STREAM_PREFIX):
            rows = (cast(Envelope[Observed], logged.envelope) for logged in log.read(stream, kinds=KINDS))
            yield from drives_of(rows)


def said_counts(log: EventLog) -> Counter[str]:
    """How many events of each of its own boots filtering has appended."""
    return Counter(logged.envelope.identity.boot_id for logged in log.read(STREAM))


def _filtered(
    log: EventLog, drive: Drive, frame: MapFrame, settings: FilterSettings, said: int, progress: Progress | None
) -> DriveReport:
    track = begun_track(drive, frame, settings)
    publication = Published(output_boot_id(drive.vehicle, drive.boot_id, frame, settings))
    rows: list[Envelope[Estimated]] = []
    for track in tracks(drive, frame, settings, progress=progress):
        told, publication = published(track, publication, settings)
        rows += told
    fresh = cast(list[Envelope[Event]], rows[said:])
    if fresh:
        log.append(STREAM, fresh)
    posed = any(isinstance(row.event, PoseFiltered) for row in rows)
    report = _report(drive, rows, appended=len(fresh), refusal="" if posed else track.refusal)
    if report.refusal:
        logger.warning("drive %s of %s has no pose: %s", drive.boot_id, drive.vehicle, report.refusal)
    return report


def _report(drive: Drive, rows: list[Envelope[Estimated]], *, appended: int, refusal: str) -> DriveReport:
    verdicts = Counter(row.event.accepted for row in rows if isinstance(row.event, FixJudged))
    return DriveReport(
        vehicle=drive.vehicle,
        boot_id=drive.boot_id,
        accepted=verdicts[True],
        rejected=verdicts[False],
        appended=appended,
        refusal=refusal,
    )
