"""Filtering at work on a log: every drive in it filtered, what was not yet said of it appended."""

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

from trigpoint.events.codec import Event
from trigpoint.events.drives import Drive, drives_of
from trigpoint.events.envelope import Envelope
from trigpoint.events.estimated import Estimated, FixJudged
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.observed import (
    GnssFixReceived,
    ImuMeasured,
    Observed,
    VehicleDescribed,
    WheelPairMeasured,
    WheelSpeedMeasured,
)
from trigpoint.geodesy.projection import MapFrame
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import FRAME_STREAM, Progress, pinned_frame, vehicle_streams
from trigpoint_filtering.core.publication import UNSAID, Published, Said, output_boot_id, published
from trigpoint_filtering.core.track import begun_track, tracks
from trigpoint_filtering.settings import FilterSettings

STREAM = STREAM_PATTERNS[FixJudged]
KINDS = (VehicleDescribed, WheelSpeedMeasured, WheelPairMeasured, ImuMeasured, GnssFixReceived)

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
    chosen, frame, said = settings or FilterSettings(), pinned_frame(log), said_of(log)
    if frame is None:
        logger.warning("nothing filtered: no map frame is pinned in stream %r", FRAME_STREAM)
        return ()
    reports = []
    for drive in logged_drives(log):
        before = said.get(output_boot_id(drive.vehicle, drive.boot_id, frame, chosen), UNSAID)
        reports.append(_filtered(log, drive, frame, chosen, before, progress))
    return tuple(reports)


def logged_drives(log: EventLog) -> Iterator[Drive]:
    """The drives in the log, one vehicle's after the other's, without their landmark detections."""
    for stream in vehicle_streams(log):
        yield from drives_of(cast(Envelope[Observed], logged.envelope) for logged in log.read(stream, kinds=KINDS))


def said_of(log: EventLog) -> dict[str, Said]:
    """What filtering has appended so far, by its own boots."""
    said: dict[str, Said] = {}
    for logged in log.read(STREAM):
        boot_id = logged.envelope.identity.boot_id
        said[boot_id] = said.get(boot_id, UNSAID).with_row(cast(Envelope[Estimated], logged.envelope))
    return said


def _filtered(
    log: EventLog, drive: Drive, frame: MapFrame, settings: FilterSettings, said: Said, progress: Progress | None
) -> DriveReport:
    if said.is_whole(drive):
        return _report(drive, said, appended=0, refusal="")
    track = begun_track(drive, frame, settings)
    publication = Published(output_boot_id(drive.vehicle, drive.boot_id, frame, settings))
    rows: list[Envelope[Estimated]] = []
    for track in tracks(drive, frame, settings, progress=progress):
        told, publication = published(track, publication, settings)
        rows += told
    fresh = cast(list[Envelope[Event]], rows[said.count :])
    if fresh:
        log.append(STREAM, fresh)
    whole = UNSAID.with_rows(rows)
    if not whole.poses:
        logger.warning("drive %s of %s has no pose: %s", drive.boot_id, drive.vehicle, track.refusal)
    return _report(drive, whole, appended=len(fresh), refusal="" if whole.poses else track.refusal)


def _report(drive: Drive, said: Said, *, appended: int, refusal: str) -> DriveReport:
    return DriveReport(
        vehicle=drive.vehicle,
        boot_id=drive.boot_id,
        accepted=said.accepted,
        rejected=said.verdicts - said.accepted,
        appended=appended,
        refusal=refusal,
    )
