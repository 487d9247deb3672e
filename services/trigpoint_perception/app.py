"""Perception at work on a log: every drive's sweeps searched, what was not yet said of them appended."""

import logging
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import cast

from trigpoint.errors import ServiceError
from trigpoint.events.codec import Event
from trigpoint.events.corrected import excluded_drives
from trigpoint.events.envelope import Envelope
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.observed import Observed
from trigpoint.events.perceived import LandmarksPerceived, OdometryMatched, SweepPerceived
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import Progress, in_silence, logged_corrections, vehicle_streams
from trigpoint.workers import Tally, Workers
from trigpoint_perception.core.drive_following import DriveFollower
from trigpoint_perception.core.motion_window import MOTION_KINDS
from trigpoint_perception.core.perceiving import CORNER, POLE
from trigpoint_perception.core.publication import Said, Spoken, output_boot_id
from trigpoint_perception.settings import PerceptionSettings

STREAM = STREAM_PATTERNS[LandmarksPerceived]
SWEEP_KINDS = (LandmarksPerceived, OdometryMatched)  # what is told sweep by sweep
KINDS = (PointsScanned, *MOTION_KINDS)
APPENDED_TOGETHER = 200  # events

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class ScannedDrive:
    """A drive with sweeps: where they are, and how many."""

    stream: str
    vehicle: str
    boot_id: str
    sweeps: int

    @property
    def name(self) -> tuple[str, str]:
        """Vehicle and boot."""
        return self.vehicle, self.boot_id


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
    log: EventLog,
    open_log: Callable[[], EventLog],
    settings: PerceptionSettings | None = None,
    *,
    some: Workers,
    progress: Progress = in_silence,
) -> tuple[DriveReport, ...]:
    """The sweeps of every drive that is not excluded searched, drive by drive by some workers, each of which opens the
    log to read it; told of in `log`; again: nothing is appended twice.

    A sweep that cannot be used is told of with the reason, and the others go on; a drive that cannot be read or ended
    its workers costs no other. Raises AppendFailed, and once all others are done ServiceError for those drives.
    """
    chosen, drives = settings or PerceptionSettings(), scanned_drives(log)
    said, spoken = said_of(log)
    before = {drive.name: said.get(output_boot_id(*drive.name, chosen), Said()) for drive in drives}
    reports = {drive.name: _report(drive, before[drive.name], appended=0) for drive in drives}
    due = [drive for drive in drives if before[drive.name].sweeps != drive.sweeps]
    heard = Tally(sum(drive.sweeps for drive in due), progress)
    searched = partial(told_of, open_log, chosen, heard=heard.more if some.are_here else None)
    failures = []
    for done in some.each(searched, due):
        drive = done.item
        if done.result is None:
            failures.append(f"drive {drive.boot_id} of {drive.vehicle}: {done.error}")
            continue
        if not some.are_here:
            heard.more(drive.sweeps)
        reports[drive.name] = _appended(log, drive, done.result, spoken, chosen)
    if failures:
        raise ServiceError(f"{len(failures)} of {len(due)} drives not perceived: {'; '.join(failures)}")
    return tuple(reports.values())


def told_of(
    open_log: Callable[[], EventLog],
    settings: PerceptionSettings,
    drive: ScannedDrive,
    *,
    heard: Callable[[int], None] | None = None,
) -> list[tuple[int, SweepPerceived]]:
    """Every event of a drive with its stamp; `heard` is told of each sweep."""
    log = open_log()
    try:
        return list(_told(log, drive, settings, heard or _in_silence))
    finally:
        log.close()


def _in_silence(count: int) -> None:
    """Nobody is told."""


def scanned_drives(log: EventLog) -> tuple[ScannedDrive, ...]:
    """The drives with sweeps that are not excluded; no sweep is decoded for it."""
    excluded = excluded_drives(logged_corrections(log))
    return tuple(
        ScannedDrive(stream=stream, vehicle=name[0], boot_id=name[1], sweeps=count)
        for stream, counts in sweep_counts(log)
        for name, count in counts.items()
        if name not in excluded
    )


def sweep_counts(log: EventLog) -> Iterator[tuple[str, Mapping[tuple[str, str], int]]]:
    """How many sweeps there are of each drive, in order of the drives' first ones, by the vehicles' streams."""
    for stream in vehicle_streams(log):
        counts: Counter[tuple[str, str]] = Counter()
        for logged in log.read_runs(stream, kinds=(PointsScanned,)):
            counts[logged.run.source, logged.run.boot_id] += len(logged.run)
        yield stream, counts


def said_of(log: EventLog) -> tuple[dict[str, Said], Spoken]:
    """What perception has appended so far, by its own boots, and so that nothing is said twice."""
    said: dict[str, Said] = {}
    spoken = Spoken({})
    for logged in log.read(STREAM, kinds=SWEEP_KINDS):
        row = cast(Envelope[SweepPerceived], logged.envelope)
        said.setdefault(row.identity.boot_id, Said()).add(row.event)
        spoken.add(row)
    return said, spoken


def _appended(
    log: EventLog,
    drive: ScannedDrive,
    told: Sequence[tuple[int, SweepPerceived]],
    spoken: Spoken,
    settings: PerceptionSettings,
) -> DriveReport:
    """What was not there yet appended."""
    whole = Said()
    for _, event in told:
        whole.add(event)
    boot_id = output_boot_id(drive.vehicle, drive.boot_id, settings)
    rows = spoken.fresh(told, boot_id=boot_id)
    for first in range(0, len(rows), APPENDED_TOGETHER):
        log.append(STREAM, cast(list[Envelope[Event]], list(rows[first : first + APPENDED_TOGETHER])))
    for reason, count in sorted(whole.refused.items()):
        logger.warning("drive %s of %s: %d sweeps refused: %s", drive.boot_id, drive.vehicle, count, reason)
    return _report(drive, whole, appended=len(rows))


def _told(
    log: EventLog, drive: ScannedDrive, settings: PerceptionSettings, heard: Callable[[int], None]
) -> Iterator[tuple[int, SweepPerceived]]:
    """Every event of a drive, in the order of its sweeps."""
    follower = DriveFollower(drive.vehicle, drive.boot_id, settings)
    for logged in log.read(drive.stream, kinds=KINDS):
        envelope = cast(Envelope[Observed], logged.envelope)
        if envelope.identity.boot_id != drive.boot_id:
            continue
        yield from follower.take(envelope)
        if isinstance(envelope.event, PointsScanned):
            heard(1)
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
