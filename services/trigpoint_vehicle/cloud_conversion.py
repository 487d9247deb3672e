"""Drives with points, written scan by scan: however many there are, one is in memory."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from trigpoint.errors import InputError
from trigpoint.events.observed import VehicleDescribed
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.vehicle_log import write_vehicle_log
from trigpoint_vehicle.core.recording import Timed, merged_rows

POINTS_LIMIT = 2_000_000  # of a sweep in a log: 44 MB, and far more than ingest takes


@dataclass(slots=True)
class LeftAside:
    """What of a source did not become events: counted by reason, with the first of each in full."""

    counts: Counter[str] = field(default_factory=Counter)
    first: dict[str, str] = field(default_factory=dict)

    def add(self, reason: str, detail: str) -> None:
        """One more was left aside."""
        self.counts[reason] += 1
        self.first.setdefault(reason, detail)

    def complaints(self) -> tuple[str, ...]:
        """A line for each reason."""
        return tuple(f"{count} left aside, {reason}: {self.first[reason]}" for reason, count in self.counts.items())


@dataclass(frozen=True, slots=True, kw_only=True)
class CloudDrive:
    """A vehicle's drive to be written: streams of events, each in order of stamp, read as they are written."""

    described: VehicleDescribed
    boot_id: str
    streams: tuple[Iterable[Timed], ...]
    left_aside: LeftAside


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenClouds:
    """A drive's log, how many events by class are in it, and what was left aside."""

    log: Path
    counts: dict[str, int]
    left_aside: LeftAside


def write_cloud_drive(drive: CloudDrive, out_dir: Path) -> WrittenClouds:
    """The drive's `<vehicle>.mcap` in the folder. Raises InputError for a folder that cannot be written, AppendFailed
    for the log.
    """
    vehicle, counts = drive.described.vehicle, Counter[str]()
    path = out_dir / f"{vehicle}.mcap"
    streams = [_counted(writable(stream, drive.left_aside), counts) for stream in drive.streams]
    try:
        out_dir.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{out_dir}: cannot be written: {error}") from error
    write_vehicle_log(path, merged_rows(drive.described, streams, boot_id=drive.boot_id), vehicle=vehicle)
    return WrittenClouds(log=path, counts=dict(counts), left_aside=drive.left_aside)


def _counted(stream: Iterable[Timed], counts: Counter[str]) -> Iterator[Timed]:
    for stamp_ns, event in stream:
        counts[type(event).__name__] += 1
        yield stamp_ns, event


def writable(stream: Iterable[Timed], aside: LeftAside) -> Iterator[Timed]:
    """The events but for sweeps that are too large for a log, which are left aside."""
    for stamp_ns, event in stream:
        if isinstance(event, PointsScanned) and len(event.point_m) > POINTS_LIMIT:
            detail = f"{len(event.point_m)} points at {stamp_ns} ns, limit {POINTS_LIMIT}"
            aside.add("too many points", detail)
        else:
            yield stamp_ns, event
