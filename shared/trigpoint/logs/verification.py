"""Whether log files are as they were written, and what is in them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from trigpoint.errors import InputError
from trigpoint.events.seen import SeenSequences
from trigpoint.logs.channels import ChannelKey
from trigpoint.logs.chunks import ChunkMessage, messages
from trigpoint.logs.log_files import SUFFIX, file_numbers
from trigpoint.logs.mcap_scan import UNKNOWN, McapScan


@dataclass(frozen=True, slots=True)
class Finding:
    """Something wrong with a file. `kind` is one of "damaged", "unfinished" (its writer died, or still writes),
    "number gap", "repeated identity", "unknown channel"; `lost_messages` -1 where it cannot be told."""

    path: Path
    offset: int
    kind: str
    detail: str
    lost_messages: int = 0


@dataclass(frozen=True, slots=True)
class TopicSummary:
    """The messages of one topic in a file, and the times [start, end] they span."""

    topic: str
    schema_name: str
    count: int
    start_ns: int
    end_ns: int


@dataclass(frozen=True, slots=True)
class BootSummary:
    """The events of one boot of a source over all files looked at; `missing` are sequences between its first and
    last that are not there (refused, kept elsewhere, or lost)."""

    source: str
    boot_id: str
    count: int
    missing: int


@dataclass(frozen=True, slots=True)
class FileSummary:
    """What the whole part of a file holds. Times [start, end] are 0 for an empty one."""

    path: Path
    stream: str
    size_bytes: int
    count: int
    start_ns: int
    end_ns: int
    vehicles: tuple[str, ...]
    topics: tuple[TopicSummary, ...]
    metadata: Mapping[str, Mapping[str, str]]


@dataclass(frozen=True, slots=True)
class Verification:
    """The files looked at and all that is wrong with them; nothing is if `findings` is empty."""

    files: tuple[FileSummary, ...]
    boots: tuple[BootSummary, ...]
    findings: tuple[Finding, ...]


@dataclass(slots=True)
class _Tally:
    """Stamps by channel while a file is read."""

    stamps_ns: dict[int, list[int]] = field(default_factory=dict)

    def add(self, channel_id: int, stamp_ns: int) -> None:
        self.stamps_ns.setdefault(channel_id, []).append(stamp_ns)

    def topics(self, channels: Mapping[int, ChannelKey]) -> tuple[TopicSummary, ...]:
        grouped: dict[tuple[str, str], list[int]] = {}
        for channel_id, stamps_ns in self.stamps_ns.items():
            key = channels[channel_id]
            grouped.setdefault((key.topic, key.schema_name), []).extend(stamps_ns)
        return tuple(
            TopicSummary(*name, len(stamps_ns), min(stamps_ns), max(stamps_ns))
            for name, stamps_ns in sorted(grouped.items())
        )


class _Verifier:
    """Goes through files and gathers what is wrong with them."""

    def __init__(self) -> None:
        self.seen = SeenSequences()
        self.findings: list[Finding] = []

    def file(self, path: Path, stream: str) -> FileSummary:
        scan, tally = McapScan(path), _Tally()
        for chunk in scan.chunks():
            for message in messages(chunk.data):
                self._message(scan, chunk.offset, message, tally)
        self._damages(scan)
        topics = tally.topics(scan.channels)
        return FileSummary(
            path=path,
            stream=stream,
            size_bytes=path.stat().st_size,
            count=sum(topic.count for topic in topics),
            start_ns=min((topic.start_ns for topic in topics), default=0),
            end_ns=max((topic.end_ns for topic in topics), default=0),
            vehicles=tuple(sorted({scan.channels[number].vehicle for number in tally.stamps_ns} - {""})),
            topics=topics,
            metadata=scan.metadata,
        )

    def _message(self, scan: McapScan, offset: int, message: ChunkMessage, tally: _Tally) -> None:
        key = scan.channels.get(message.channel_id)
        if key is None:
            detail = f"message {message.mcap_sequence} of channel {message.channel_id}, which is not defined"
            self.findings.append(Finding(scan.path, offset, "unknown channel", detail, 1))
            return
        tally.add(message.channel_id, message.log_time_ns)
        identity = key.identity(message.mcap_sequence)
        if identity.source and not self.seen.add(identity):
            self.findings.append(Finding(scan.path, offset, "repeated identity", str(identity)))

    def _damages(self, scan: McapScan) -> None:
        kind = "unfinished" if scan.torn_tail else "damaged"
        self.findings += [
            Finding(scan.path, damage.offset, kind, damage.reason, damage.lost_messages) for damage in scan.damages
        ]

    def numbers(self, files: Iterable[FileSummary]) -> None:
        """Files of a stream follow one another without gap: each begins where the one before ended."""
        expected = 0
        for file in files:
            first = int(file.path.stem)
            if first != expected:
                detail = f"first event has number {first}, expected {expected}"
                self.findings.append(Finding(file.path, 0, "number gap", detail, max(first - expected, UNKNOWN)))
            expected = first + file.count

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
    verifier, files = _Verifier(), []
    for folder, numbered in _folders(path):
        summaries = [verifier.file(file, folder.name if numbered else file.stem) for file in _files(path, folder)]
        if numbered:
            verifier.numbers(summaries)
        files += summaries
    if not files:
        raise InputError(f"{path}: no {SUFFIX} file there")
    return Verification(tuple(files), verifier.boots(), tuple(verifier.findings))


def _folders(path: Path) -> list[tuple[Path, bool]]:
    """Folders with log files, and whether their files are numbered as a stream's are."""
    if path.is_file():
        return [(path.parent, False)]
    if not path.is_dir():
        raise InputError(f"{path}: no such file or directory")
    within = [
        folder for folder in (path, *sorted(path.iterdir())) if folder.is_dir() and any(folder.glob(f"*{SUFFIX}"))
    ]
    return [(folder, len(file_numbers(folder)) == len(list(folder.glob(f"*{SUFFIX}")))) for folder in within]


def _files(path: Path, folder: Path) -> list[Path]:
    return [path] if path.is_file() else sorted(folder.glob(f"*{SUFFIX}"))
