"""A damaged log written anew: everything whole under its old numbers, what is lost recorded, the result verified."""

import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from trigpoint.durable_files import sync_folder
from trigpoint.errors import InputError, LogDamaged, ServiceError
from trigpoint.events.seen import SeenSequences
from trigpoint.logs.absences import NAME as ABSENCES_NAME
from trigpoint.logs.absences import (
    Absence,
    Reason,
    record_absences,
    recorded_absences,
    uncovered,
)
from trigpoint.logs.catalog import NAME as CATALOG_NAME
from trigpoint.logs.catalog import Catalog, renewed_once
from trigpoint.logs.chunks import messages
from trigpoint.logs.log_files import file_numbers, file_path
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.mcap_scan import McapScan
from trigpoint.logs.salvage import Knowledge, Salvage, salvaged, write_salvage
from trigpoint.logs.seals import seal_finished
from trigpoint.logs.verification import Verification, verify

Told = Callable[[Path], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingSequences:
    """Sequences [start, stop) of a boot that are neither in the recovered stream nor recorded as retained away: lost,
    or refused when they came."""

    source: str
    boot_id: str
    start: int
    stop: int


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamRecovery:
    """What became of a stream: events whole, half-open ranges of numbers lost, identities missing in streams with a
    loss, what was damaged, and files whose numbers after a damage are the lowest they can have been.

    `end_unknown`: the last file is damaged at its end, and nothing tells how many events stood there.
    """

    stream: str
    count: int
    lost_ranges: tuple[tuple[int, int], ...]
    missing: tuple[MissingSequences, ...]
    damages: tuple[str, ...]
    uncertain_files: tuple[Path, ...]
    end_unknown: bool

    @property
    def lost_count(self) -> int:
        """How many events are lost, as far as it is known."""
        return sum(stop - first for first, stop in self.lost_ranges)


def recover(source: Path, out: Path, *, told: Told = lambda path: None) -> tuple[StreamRecovery, ...]:
    """Every stream of a log directory recovered into a new one; `source` is only read.

    `told` hears of each file before it is looked at. Raises InputError where there is no log or `out` holds
    something, ServiceError if what was written does not verify or cannot be written.
    """
    if not source.is_dir():
        raise InputError(f"{source}: no such log directory")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out}: holds something already, a log is recovered into a new directory")
    try:
        out.mkdir(parents=True, exist_ok=True)
        with _catalog_copy(source) as catalog:
            folders = [source / stream for stream in _streams(source, catalog)]
            recovered = tuple(_recover_stream(folder, out / folder.name, catalog, told) for folder in folders)
        sync_folder(out)
        _check(out, recovered)
    except (OSError, LogDamaged) as error:
        raise ServiceError(f"{out}: not recovered: {error}") from error
    return recovered


def _streams(source: Path, catalog: Catalog) -> list[str]:
    """Every stream that there are files or records of, or that the catalog knows."""
    inside = [path for path in source.iterdir() if path.is_dir() and not path.name.startswith(".")]
    there = {folder.name for folder in inside if file_numbers(folder) or (folder / ABSENCES_NAME).exists()}
    streams = there | set(renewed_once(catalog.streams))
    if not streams:
        raise InputError(f"{source}: no log directory: no folder with numbered files in there")
    return sorted(streams)


@contextmanager
def _catalog_copy(source: Path) -> Iterator[Catalog]:
    """What the source's catalog still says, from a copy: a damaged one is taken away."""
    with tempfile.TemporaryDirectory(prefix="trigpoint-recover-") as folder:
        for suffix in ("", "-wal"):
            if (source / (CATALOG_NAME + suffix)).is_file():
                shutil.copyfile(source / (CATALOG_NAME + suffix), Path(folder) / (CATALOG_NAME + suffix))
        with closing(Catalog(Path(folder) / CATALOG_NAME)) as catalog:
            yield catalog


def _recover_stream(folder: Path, out: Path, catalog: Catalog, told: Told) -> StreamRecovery:
    out.mkdir()
    absences, damages = _absences(folder)
    known_end = renewed_once(lambda: catalog.next_number(folder.name))
    known_end = max([known_end, *(absence.stop_number for absence in absences)])
    files = list(_salvages(folder, catalog, told))
    for file in files:
        write_salvage(file, out)
    whole = [span for file in files for span in file.ranges]
    end = max([known_end, *(stop for _, stop in whole), *(file.said_stop for file in files)])
    lost = uncovered(_holes(whole, end), absences)
    new = [Absence(first_number=first, stop_number=stop, reason=Reason.LOST) for first, stop in lost]
    if absences or new:
        record_absences(out, [*absences, *new])
    seal_finished(out)
    sync_folder(out)
    return StreamRecovery(
        stream=folder.name,
        count=sum(stop - first for first, stop in whole),
        lost_ranges=lost,
        missing=_missing(out, absences) if lost else (),
        damages=(*damages, *(str(damage) for file in files for damage in file.damages)),
        uncertain_files=tuple(file.path for file in files if not all(piece.certain for piece in file.pieces)),
        end_unknown=bool(files and files[-1].damages) and end == max((stop for _, stop in whole), default=0),
    )


def _absences(folder: Path) -> tuple[tuple[Absence, ...], tuple[str, ...]]:
    """What the source says was gone already, and what is wrong with that."""
    try:
        return recorded_absences(folder), ()
    except LogDamaged as error:
        return (), (str(error),)


def _salvages(folder: Path, catalog: Catalog, told: Told) -> Iterator[Salvage]:
    numbers = file_numbers(folder)
    ends = dict(zip(numbers, numbers[1:], strict=False))  # the last may have outgrown the catalog
    for number in numbers:
        path = file_path(folder, number)
        told(path)
        yield salvaged(path, stop_number=ends.get(number), known=_knowledge(catalog, folder.name, number))


def _knowledge(catalog: Catalog, stream: str, number: int) -> Knowledge:
    chunks = renewed_once(lambda: catalog.file_chunks(stream, number))
    channels = renewed_once(lambda: catalog.channels(stream, number))
    return Knowledge({chunk.offset: (chunk.number, chunk.count) for chunk in chunks}, channels)


def _holes(whole: Sequence[tuple[int, int]], end: int) -> tuple[tuple[int, int], ...]:
    """The half-open ranges of [0, end) that are in none of the ascending ranges."""
    starts = [0, *(stop for _, stop in whole)]
    stops = [*(first for first, _ in whole), end]
    return tuple((start, stop) for start, stop in zip(starts, stops, strict=True) if start < stop)


def _missing(out: Path, absences: Sequence[Absence]) -> tuple[MissingSequences, ...]:
    """What lies between the sequences of each boot that are there or were retained away."""
    seen = SeenSequences()
    for number in file_numbers(out):
        scan = McapScan(file_path(out, number))
        for chunk in scan.chunks():
            for message in messages(chunk.data):
                seen.add(scan.channels[message.channel_id].identity(message.mcap_sequence))
    retained = {(boot.source, boot.boot_id): boot.ranges for absence in absences for boot in absence.boots}
    found = []
    for source, boot_id in seen.boots():
        there = sorted((*seen.ranges(source, boot_id), *retained.get((source, boot_id), ())))
        stop = there[0][0]
        for first, following in there:
            if first > stop:
                found.append(MissingSequences(source=source, boot_id=boot_id, start=stop, stop=first))
            stop = max(stop, following)
    return tuple(found)


def _check(out: Path, recovered: Sequence[StreamRecovery]) -> None:
    """The new log opened and verified. Raises LogDamaged if it is not what it was written as."""
    verification = verify(out)
    for finding in verification.findings:
        if finding.kind != "repeated identity":  # was so before: the numbers of all others would change
            raise LogDamaged(f"{finding.path}, byte {finding.offset}: {finding.kind}: {finding.detail}")
    with closing(McapLog(out)) as log:
        for stream in recovered:
            held = sum(contents.count for contents in log.contents(stream.stream))
            if not held == stream.count == _verified_count(verification, stream.stream):
                raise LogDamaged(f"stream {stream.stream}: {held} events opened, {stream.count} were written")


def _verified_count(verification: Verification, stream: str) -> int:
    return sum(file.count for file in verification.files if file.stream == stream)
