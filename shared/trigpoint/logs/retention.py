"""Which sealed files of a log may go, and their going: recorded first, so that a log never just lacks something."""

import fcntl
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from trigpoint.durable_files import sync_folder
from trigpoint.errors import InputError, LogDamaged
from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.mapped import MapSolved
from trigpoint.events.observed import MapFramePinned
from trigpoint.events.seen import SeenSequences
from trigpoint.logs.absences import Absence, BootRanges, Reason, record_absences, recorded_absences
from trigpoint.logs.catalog import FileContents
from trigpoint.logs.chunks import messages
from trigpoint.logs.log_files import file_path
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.mcap_scan import McapScan
from trigpoint.logs.seals import is_sealed, seal_fault, seal_path

FRAME_STREAM, CORRECTION_STREAM = STREAM_PATTERNS[MapFramePinned], STREAM_PATTERNS[AnchorLabelled]
MAP_STREAM = STREAM_PATTERNS[MapSolved]
LOCK_NAME = ".retention-lock"  # in a log's directory, held by whoever takes files away

Checkpoints = Mapping[str, Mapping[str, int]]  # by reader: by stream the next number it has to read


@dataclass(frozen=True, slots=True)
class Obstacle:
    """From which number on a stream has to stay, and why."""

    number: int
    reason: str


UNKNOWN = Obstacle(0, "it began while the log was looked at")


@dataclass(frozen=True, slots=True, kw_only=True)
class LogFile:
    """A file of a stream with the numbers [first_number, stop_number), times in [start_ns, end_ns]."""

    stream: str
    first_number: int
    stop_number: int
    size_bytes: int
    start_ns: int
    end_ns: int
    sealed: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Keeping:
    """What of a log is to stay: events younger than `newer_than_ns`, or the newest `total_bytes` of it."""

    newer_than_ns: int | None = None
    total_bytes: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RetentionPlan:
    """The files to go, in their order, and by stream why the first one that stays has to."""

    removed: tuple[LogFile, ...]
    kept_because: tuple[tuple[str, str], ...]
    total_bytes: int

    @property
    def freed_bytes(self) -> int:
        """What goes, in bytes."""
        return sum(file.size_bytes for file in self.removed)


def planned_retention(
    files: Mapping[str, Sequence[LogFile]], obstacles: Mapping[str, Obstacle], keeping: Keeping
) -> RetentionPlan:
    """The files that may and should go, of each stream the oldest only, one behind the other.

    `files` by stream in the order of their numbers; a stream of which no obstacle is known stays.
    """
    total = sum(file.size_bytes for own in files.values() for file in own)
    may_go, reasons = [], {}
    for stream, own in files.items():
        free, reasons[stream] = _free(own, obstacles.get(stream, UNKNOWN))
        may_go += free
    by_age = sorted(may_go, key=lambda file: (file.stream, file.first_number))
    gone = _too_old(by_age, keeping.newer_than_ns) if keeping.total_bytes is None else _too_many(by_age, total, keeping)
    stays = {stream: reasons[stream] for stream, own in files.items() if own and len(own) > _count(gone, stream)}
    kept = ((s, "it is young enough" if _count(gone, s) < _count(may_go, s) else why) for s, why in stays.items())
    return RetentionPlan(removed=tuple(gone), kept_because=tuple(kept), total_bytes=total)


def _free(files: Sequence[LogFile], obstacle: Obstacle) -> tuple[list[LogFile], str]:
    """The first files that nothing holds, and what holds the next."""
    free: list[LogFile] = []
    for file in files:
        if not file.sealed:
            return free, f"file {file.first_number} is not sealed"
        if file.stop_number > obstacle.number:
            return free, obstacle.reason
        free.append(file)
    return free, ""


def _too_old(files: Sequence[LogFile], newer_than_ns: int | None) -> list[LogFile]:
    """Of each stream the files before the first one with something young enough."""
    gone: list[LogFile] = []
    stopped: set[str] = set()
    for file in files:
        if newer_than_ns is None or file.end_ns >= newer_than_ns:
            stopped.add(file.stream)
        if file.stream not in stopped:
            gone.append(file)
    return gone


def _too_many(files: Sequence[LogFile], total_bytes: int, keeping: Keeping) -> list[LogFile]:
    """The oldest files, as many as it takes for the log to be small enough; none before one older of its stream."""
    latest_ns: dict[str, int] = {}
    ranked = []
    for file in files:
        latest_ns[file.stream] = max(latest_ns.get(file.stream, 0), file.end_ns)
        ranked.append((latest_ns[file.stream], file.stream, file.first_number, file))
    gone = []
    for *_, file in sorted(ranked, key=lambda one: one[:3]):
        if total_bytes <= (keeping.total_bytes or 0):
            break
        gone.append(file)
        total_bytes -= file.size_bytes
    return gone


def _count(files: Iterable[LogFile], stream: str) -> int:
    return sum(file.stream == stream for file in files)


def log_files(log: McapLog) -> dict[str, list[LogFile]]:
    """Every file of a log by stream, in order."""
    return {stream: [_log_file(log, contents) for contents in log.contents(stream)] for stream in log.streams()}


def _log_file(log: McapLog, contents: FileContents) -> LogFile:
    file = contents.file
    return LogFile(
        stream=file.stream,
        first_number=file.first_number,
        stop_number=file.first_number + contents.count,
        size_bytes=file.size_bytes,
        start_ns=contents.start_ns,
        end_ns=contents.end_ns,
        sealed=file.finished and is_sealed(file_path(log.directory / file.stream, file.first_number)),
    )


def obstacles(log: McapLog, passed: Checkpoints, *, also_inputs: bool) -> dict[str, Obstacle]:
    """From where on each stream has to stay: what some reader has not passed, the map's frame, corrections, the newest
    map version with those it builds on, and, unless told otherwise, everything it was solved from."""
    found = {stream: _unread(stream, passed) for stream in log.streams()}
    for stream in (FRAME_STREAM, CORRECTION_STREAM):
        found[stream] = Obstacle(0, "the map's frame and its corrections always stay")
    versions = _versions(log)
    if versions:
        newest, begins = versions[-1][0], _oldest_needed(versions)
        if begins < found[MAP_STREAM].number:
            found[MAP_STREAM] = Obstacle(begins, f"map version {newest.map_version} or one it builds on")
        for stream, count in newest.inputs if not also_inputs else ():
            if count and found.get(stream, Obstacle(0, "")).number > 0:
                found[stream] = Obstacle(0, f"map version {newest.map_version} was solved from it")
    return found


def _unread(stream: str, passed: Checkpoints) -> Obstacle:
    """Up to where every reader that reads the stream has read it; nothing of a stream nobody says to have read."""
    readers = [(numbers[stream], reader) for reader, numbers in passed.items() if stream in numbers]
    if not readers:
        return Obstacle(0, "no checkpoint names it")
    number, reader = min(readers)
    return Obstacle(number, f"{reader} has passed it up to number {number} only")


def _versions(log: McapLog) -> list[tuple[MapSolved, int]]:
    """The map versions and the number of the first event of each."""
    versions, begins = [], log.begins_at(MAP_STREAM)
    for row in log.read(MAP_STREAM, kinds=(MapSolved,)):
        if isinstance(row.envelope.event, MapSolved):
            versions.append((row.envelope.event, begins))
            begins = row.position.number + 1
    return versions


def _oldest_needed(versions: Sequence[tuple[MapSolved, int]]) -> int:
    """Where the oldest version begins that the newest builds on."""
    by_version = {solved.map_version: (solved, begins) for solved, begins in versions}
    solved, begins = versions[-1]
    oldest = begins
    while solved.base_version and solved.base_version in by_version:
        solved, begins = by_version.pop(solved.base_version)
        oldest = min(oldest, begins)
    return oldest


def remove_files(directory: Path, files: Sequence[LogFile]) -> None:
    """The files recorded as retained away, then taken away, stream by stream.

    Raises LogDamaged, before anything of its stream is gone, for a file that is not what was sealed; InputError while
    another process takes files away, OSError.
    """
    with _alone(directory):
        for stream in dict.fromkeys(file.stream for file in files):
            _remove(directory / stream, [file for file in files if file.stream == stream])


@contextmanager
def _alone(directory: Path) -> Iterator[None]:
    """Nobody else takes files of this log away: two at once would each record only what they took themselves."""
    with (directory / LOCK_NAME).open("ab") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError(f"{directory}: another process takes files away: one at a time") from error
        yield


def _remove(folder: Path, files: Sequence[LogFile]) -> None:
    known = {(absence.first_number, absence.stop_number) for absence in recorded_absences(folder)}
    new = [_absence(folder, file) for file in files if (file.first_number, file.stop_number) not in known]
    record_absences(folder, new)
    for file in files:
        path = file_path(folder, file.first_number)
        path.unlink(missing_ok=True)
        seal_path(path).unlink(missing_ok=True)
    sync_folder(folder)


def _absence(folder: Path, file: LogFile) -> Absence:
    """What a file holds, as it is remembered; duplicates of what is gone are still known by it."""
    path = file_path(folder, file.first_number)
    fault = seal_fault(path)
    if fault:
        raise LogDamaged(f"{path}: {fault}: not taken away")
    scan, seen = McapScan(path), SeenSequences()
    for chunk in scan.chunks():
        for message in messages(chunk.data):
            seen.add(scan.channels[message.channel_id].identity(message.mcap_sequence))
    boots = tuple(BootRanges(source, boot_id, seen.ranges(source, boot_id)) for source, boot_id in seen.boots())
    return Absence(
        first_number=file.first_number,
        stop_number=file.stop_number,
        reason=Reason.RETAINED,
        start_ns=file.start_ns,
        end_ns=file.end_ns,
        boots=boots,
    )
