"""Whether log files are as they were written, and what is in them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from trigpoint.errors import InputError, LogDamaged
from trigpoint.events.seen import SeenSequences
from trigpoint.logs.absences import NAME as ABSENCES_NAME
from trigpoint.logs.absences import Absence, recorded_absences, uncovered
from trigpoint.logs.catalog_verification import catalog_findings, known_files
from trigpoint.logs.channels import ChannelKey
from trigpoint.logs.chunks import ChunkMessage, messages
from trigpoint.logs.findings import FileSummary, Finding, TopicSummary
from trigpoint.logs.log_files import SUFFIX, file_numbers, file_path, has_writer
from trigpoint.logs.mcap_scan import UNKNOWN, McapScan
from trigpoint.logs.seals import is_sealed, orphan_seals, seal_fault

FINDINGS_LIMIT = 10_000  # of single messages, in all files looked at


@dataclass(frozen=True, slots=True)
class BootSummary:
    """The events of one boot of a source over all files looked at; `missing` are sequences between its first and
    last that are not there (refused, kept elsewhere, or lost)."""

    source: str
    boot_id: str
    count: int
    missing: int


@dataclass(frozen=True, slots=True)
class Verification:
    """The files looked at and all that is wrong with them; nothing is if `findings` is empty. Of the streams being
    written the last file has no end yet, which is nothing wrong."""

    files: tuple[FileSummary, ...]
    boots: tuple[BootSummary, ...]
    findings: tuple[Finding, ...]
    absences: tuple[tuple[str, Absence], ...] = ()  # by stream, what is recorded as gone: nothing wrong
    written_streams: tuple[str, ...] = ()


@dataclass(slots=True)
class _Tally:
    """Count and times [start, end] of each channel's messages while a file is read."""

    spans: dict[int, tuple[int, int, int]] = field(default_factory=dict)

    def add(self, channel_id: int, stamp_ns: int) -> None:
        count, start_ns, end_ns = self.spans.get(channel_id, (0, stamp_ns, stamp_ns))
        self.spans[channel_id] = (count + 1, min(start_ns, stamp_ns), max(end_ns, stamp_ns))

    def topics(self, channels: Mapping[int, ChannelKey]) -> tuple[TopicSummary, ...]:
        grouped: dict[tuple[str, str], list[tuple[int, int, int]]] = {}
        for channel_id, span in self.spans.items():
            key = channels[channel_id]
            grouped.setdefault((key.topic, key.schema_name), []).append(span)
        return tuple(
            TopicSummary(*name, sum(one[0] for one in own), min(one[1] for one in own), max(one[2] for one in own))
            for name, own in sorted(grouped.items())
        )


class _Verifier:
    """Goes through files and gathers what is wrong with them."""

    def __init__(self) -> None:
        self.seen = SeenSequences()
        self.findings: list[Finding] = []
        self.absences: list[tuple[str, Absence]] = []

    def file(self, path: Path, stream: str, *, being_written: bool = False) -> FileSummary:
        scan, tally = McapScan(path), _Tally()
        for chunk in scan.chunks():
            for message in messages(chunk.data):
                self._message(scan, chunk.offset, message, tally)
        if not (being_written and scan.torn_tail):
            self._damages(scan)
        topics = tally.topics(scan.channels)
        return FileSummary(
            path=path,
            stream=stream,
            size_bytes=path.stat().st_size,
            count=sum(topic.count for topic in topics),
            start_ns=min((topic.start_ns for topic in topics), default=0),
            end_ns=max((topic.end_ns for topic in topics), default=0),
            vehicles=tuple(sorted({scan.channels[number].vehicle for number in tally.spans} - {""})),
            topics=topics,
            metadata=scan.metadata,
        )

    def _message(self, scan: McapScan, offset: int, message: ChunkMessage, tally: _Tally) -> None:
        key = scan.channels.get(message.channel_id)
        if key is None:
            detail = f"message {message.mcap_sequence} of channel {message.channel_id}, which is not defined"
            self._found(Finding(scan.path, offset, "unknown channel", detail, 1))
            return
        tally.add(message.channel_id, message.log_time_ns)
        identity = key.identity(message.mcap_sequence)
        if identity.source and not self.seen.add(identity):
            self._found(Finding(scan.path, offset, "repeated identity", str(identity)))

    def _found(self, finding: Finding) -> None:
        """One message's finding: kept, up to a number of them."""
        if len(self.findings) < FINDINGS_LIMIT:
            self.findings.append(finding)
        elif len(self.findings) == FINDINGS_LIMIT:
            detail = f"{finding.detail}; no more than {FINDINGS_LIMIT} such findings are listed"
            self.findings.append(replace(finding, detail=detail))

    def _damages(self, scan: McapScan) -> None:
        kind = "unfinished" if scan.torn_tail else "damaged"
        self.findings += [
            Finding(scan.path, damage.offset, kind, damage.reason, damage.lost_messages) for damage in scan.damages
        ]

    def stream(self, folder: Path, files: Sequence[FileSummary]) -> None:
        """Files of a stream follow one another: each begins where the one before ended, or what lies between is
        recorded as gone; seals hold, and no sealed file is missing."""
        absences = self._recorded(folder)
        expected = 0
        for file in files:
            first = int(file.path.stem)
            gaps = uncovered([(expected, first)], absences) if expected <= first else ((expected, first),)
            if gaps:
                detail = f"first event has number {first}, expected {gaps[0][0]}"
                lost = max(sum(stop - start for start, stop in gaps), UNKNOWN)
                self.findings.append(Finding(file.path, 0, "number gap", detail, lost))
            expected = first + file.count
        self._seals(folder, absences)

    def _recorded(self, folder: Path) -> tuple[Absence, ...]:
        try:
            absences = recorded_absences(folder)
        except LogDamaged as error:
            self.findings.append(Finding(folder / ABSENCES_NAME, 0, "damaged", str(error)))
            return ()
        self.absences += [(folder.name, absence) for absence in absences]
        return absences

    def _seals(self, folder: Path, absences: Sequence[Absence]) -> None:
        for path in [file_path(folder, number) for number in file_numbers(folder)]:
            fault = seal_fault(path) if is_sealed(path) else ""
            if fault:
                self.findings.append(Finding(path, 0, "broken seal", fault))
        for path in orphan_seals(folder):
            number = int(path.stem) if path.stem.isdecimal() else 0
            if uncovered([(number, number + 1)], absences):
                self.findings.append(Finding(path, 0, "missing file", "was sealed and is gone", UNKNOWN))

    def boots(self) -> tuple[BootSummary, ...]:
        return tuple(self._boot(source, boot_id) for source, boot_id in sorted(self.seen.boots()))

    def _boot(self, source: str, boot_id: str) -> BootSummary:
        ranges = self.seen.ranges(source, boot_id)
        count = sum(stop - start for start, stop in ranges)
        return BootSummary(source, boot_id, count, ranges[-1][1] - ranges[0][0] - count)


def verify(path: Path) -> Verification:
    """Every checksum, chunk, number and identity checked of a file, of a folder of files, or of a log directory.

    Raises InputError if there is no log at all.
    """
    verifier, files, known = _Verifier(), [], known_files(path)
    written: list[str] = []
    for folder, numbered in _folders(path):
        if numbered and has_writer(folder):
            written.append(folder.name)
        summaries = _summaries(verifier, path, folder, numbered=numbered, being_written=folder.name in written)
        if numbered:
            verifier.stream(folder, summaries)
        files += summaries
    verifier.findings += catalog_findings(path, known, files, verifier.absences)
    if not files and not verifier.absences:
        raise InputError(f"{path}: no {SUFFIX} file there")
    found, absences = tuple(verifier.findings), tuple(verifier.absences)
    return Verification(tuple(files), verifier.boots(), found, absences, tuple(written))


def _summaries(
    verifier: _Verifier, path: Path, folder: Path, *, numbered: bool, being_written: bool
) -> list[FileSummary]:
    """The files of a folder; of a stream that is being written, the last one may lack its end."""
    paths = _files(path, folder)
    return [
        verifier.file(one, folder.name if numbered else one.stem, being_written=being_written and one == paths[-1])
        for one in paths
    ]


def _folders(path: Path) -> list[tuple[Path, bool]]:
    """Folders with log files, and whether their files are numbered as a stream's are."""
    if path.is_file():
        return [(path.parent, False)]
    if not path.is_dir():
        raise InputError(f"{path}: no such file or directory")
    within = [
        folder
        for folder in (path, *sorted(path.iterdir()))
        if folder.is_dir() and (any(folder.glob(f"*{SUFFIX}")) or (folder / ABSENCES_NAME).exists())
    ]
    return [(folder, len(file_numbers(folder)) == len(list(folder.glob(f"*{SUFFIX}")))) for folder in within]


def _files(path: Path, folder: Path) -> list[Path]:
    return [path] if path.is_file() else sorted(folder.glob(f"*{SUFFIX}"))
