"""Perception at work on a log: every drive's sweeps searched, what was not yet said of them appended."""

import logging
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

from trigpoint.events.codec import Event
from trigpoint.events.corrected import excluded_drives
from trigpoint.events.drives import drives_of
from trigpoint.events.envelope import Envelope
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.observed import (
    ImuMeasured,
    Observed,
    VehicleDescribed,
    WheelPairMeasured,
    WheelSpeedMeasured,
)
from trigpoint.events.perceived import LandmarksPerceived, Perceived
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import Progress, in_silence, logged_corrections, vehicle_streams
from trigpoint_perception.core.deskew import Path
from trigpoint_perception.core.following import NumberedSweep, SweepFollower
from trigpoint_perception.core.motion_prior import wheel_path
from trigpoint_perception.core.perceiving import CORNER, POLE
from trigpoint_perception.core.publication import Said, numbered, output_boot_id
from trigpoint_perception.settings import PerceptionSettings

STREAM = STREAM_PATTERNS[LandmarksPerceived]
MOTION_KINDS = (VehicleDescribed, WheelSpeedMeasured, WheelPairMeasured, ImuMeasured)
APPENDED_TOGETHER = 200  # events

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class ScannedDrive:
    """A drive with sweeps: where they are, how many, and the base's path by its wheels, where there is one."""

    stream: str
    vehicle: str
    boot_id: str
    sweeps: int
    wheels: Path | None


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveReport:
    """What became of a drive's sweeps: how many there are, refused ones by reason, those matched to the one before,
    sights of landmarks and the things themselves by kind, and the events appended now."""

    vehicle: str
    boot_id: str
    sweeps: int
    refused: tuple[tuple[str, int], ...]
    matched: int
    sights: int
    poles: int
    corners: int
    appended: int


def perceive_log(
    log: EventLog, settings: PerceptionSettings | None = None, *, progress: Progress = in_silence
) -> tuple[DriveReport, ...]:
    """The sweeps of every drive that is not excluded searched, and told of; again: nothing is appended twice.

    A sweep that cannot be used is told of with the reason, and the others go on. Raises AppendFailed.
    """
    chosen, said, drives = settings or PerceptionSettings(), said_of(log), scanned_drives(log)
    total = sum(drive.sweeps for drive in drives)
    done, reports = 0, []
    for drive in drives:

        def heard(count: int, _: int, before: int = done) -> None:
            progress(before + count, total)

        before = said.get(output_boot_id(drive.vehicle, drive.boot_id, chosen), Said())
        reports.append(_perceived(log, drive, chosen, before, heard))
        done += drive.sweeps
        progress(done, total)
    return tuple(reports)


def scanned_drives(log: EventLog) -> tuple[ScannedDrive, ...]:
    """The drives with sweeps that are not excluded; no sweep is decoded for it."""
    excluded = excluded_drives(logged_corrections(log))
    drives: list[ScannedDrive] = []
    for stream in vehicle_streams(log):
        counts: Counter[tuple[str, str]] = Counter()
        for logged in log.read_runs(stream, kinds=(PointsScanned,)):
            counts[logged.run.source, logged.run.boot_id] += len(logged.run)
        wheels = _wheel_paths(log, stream) if counts else {}
        drives += [
            ScannedDrive(stream=stream, vehicle=name[0], boot_id=name[1], sweeps=count, wheels=wheels.get(name))
            for name, count in counts.items()
            if name not in excluded
        ]
    return tuple(drives)


def said_of(log: EventLog) -> dict[str, Said]:
    """What perception has appended so far, by its own boots."""
    said: dict[str, Said] = {}
    for logged in log.read(STREAM):
        event = cast(Perceived, logged.envelope.event)
        said.setdefault(logged.envelope.identity.boot_id, Said()).add(event)
    return said


def _wheel_paths(log: EventLog, stream: str) -> dict[tuple[str, str], Path | None]:
    """The path by wheels of each drive in a stream, by vehicle and boot."""
    rows = (cast(Envelope[Observed], logged.envelope) for logged in log.read(stream, kinds=MOTION_KINDS))
    return {(drive.vehicle, drive.boot_id): wheel_path(drive) for drive in drives_of(rows)}


def _perceived(
    log: EventLog, drive: ScannedDrive, settings: PerceptionSettings, before: Said, progress: Progress
) -> DriveReport:
    if before.sweeps == drive.sweeps:
        return _report(drive, before, appended=0)
    whole, fresh, appended = Said(), [], 0
    boot_id = output_boot_id(drive.vehicle, drive.boot_id, settings)
    for stamp_ns, event in _told(log, drive, settings, progress):
        whole.add(event)
        if whole.count > before.count:
            fresh.append((stamp_ns, event))
        if len(fresh) == APPENDED_TOGETHER:
            appended += _append(log, fresh, boot_id=boot_id, end=whole.count)
            fresh = []
    appended += _append(log, fresh, boot_id=boot_id, end=whole.count)
    for reason, count in sorted(whole.refused.items()):
        logger.warning("drive %s of %s: %d sweeps refused: %s", drive.boot_id, drive.vehicle, count, reason)
    return _report(drive, whole, appended=appended)


def _append(log: EventLog, told: list[tuple[int, Perceived]], *, boot_id: str, end: int) -> int:
    if told:
        log.append(
            STREAM, cast(list[Envelope[Event]], list(numbered(told, boot_id=boot_id, first_sequence=end - len(told))))
        )
    return len(told)


def _told(
    log: EventLog, drive: ScannedDrive, settings: PerceptionSettings, progress: Progress
) -> Iterator[tuple[int, Perceived]]:
    """Every event of a drive, each sensor followed by itself."""
    followers: dict[str, SweepFollower] = {}
    done = 0
    for logged in log.read(drive.stream, kinds=(PointsScanned,)):
        envelope = cast(Envelope[PointsScanned], logged.envelope)
        if envelope.identity.boot_id != drive.boot_id:
            continue
        follower = followers.get(envelope.event.sensor)
        if follower is None:
            follower = SweepFollower(drive.vehicle, drive.boot_id, settings, wheels=drive.wheels)
            followers[envelope.event.sensor] = follower
        sequence = envelope.identity.sequence
        yield from follower.take(NumberedSweep(sequence=sequence, stamp_ns=envelope.stamp_ns, scanned=envelope.event))
        done += 1
        progress(done, drive.sweeps)
    for follower in followers.values():
        yield from follower.finished()


def _report(drive: ScannedDrive, said: Said, *, appended: int) -> DriveReport:
    return DriveReport(
        vehicle=drive.vehicle,
        boot_id=drive.boot_id,
        sweeps=drive.sweeps,
        refused=tuple(sorted(said.refused.items())),
        matched=said.motions,
        sights=said.sights,
        poles=said.things_of(POLE),
        corners=said.things_of(CORNER),
        appended=appended,
    )
