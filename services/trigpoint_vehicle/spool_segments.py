"""The files of a spool: each one segment, appended to, fsynced, and deleted when nothing of it is waited for."""

import contextlib
import os
from dataclasses import dataclass
from pathlib import Path

from trigpoint.durable_files import sync_folder
from trigpoint.errors import AppendFailed

SUFFIX = ".spool"


@dataclass(slots=True, eq=False)
class Segment:
    """One file: `size` bytes written, of which `durable` bytes are fsynced; `sealed` when no more will be written.

    It holds `messages` with `payload_bytes`; of these `taken` and `taken_bytes` were read, and `waiting` of them are
    not released. `begun` once its reading began, `read` once it ended. `emptied` where its data were dropped.
    """

    number: int
    path: Path
    size: int = 0
    durable: int = 0
    sealed: bool = False
    begun: bool = False
    read: bool = False
    messages: int = 0
    payload_bytes: int = 0
    taken: int = 0
    taken_bytes: int = 0
    waiting: int = 0
    emptied: bool = False


def segment_path(folder: Path, number: int) -> Path:
    """The file of a segment; their names sort as their numbers do."""
    return folder / f"{number:012d}{SUFFIX}"


def segment_paths(folder: Path) -> list[tuple[int, Path]]:
    """The segments there are, oldest first."""
    found = [(int(path.stem), path) for path in folder.glob(f"*{SUFFIX}") if path.stem.isdigit()]
    return sorted(found)


def replace_segment(path: Path, data: bytes) -> None:
    """The file holds these bytes, or what it held before. Raises OSError."""
    partial = path.with_name(path.name + ".part")
    with partial.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)
    sync_folder(path.parent)


class SegmentWriter:
    """Appends to a new segment; a record that does not fit the disk leaves no trace."""

    def __init__(self, segment: Segment, beginning: bytes) -> None:
        self.segment = segment
        try:
            self._handle = os.open(segment.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o600)
        except OSError as error:
            raise AppendFailed(f"{segment.path}: cannot be made: {error}") from error
        self._is_listed = False  # whether the folder is known to hold it after a loss of power
        try:
            self.append(beginning)
        except AppendFailed:
            self.close()
            segment.path.unlink(missing_ok=True)
            raise

    def append(self, data: bytes) -> None:
        """The bytes are with the operating system, whole: they outlive this process. Raises AppendFailed."""
        segment = self.segment
        try:
            written = os.write(self._handle, data)
        except OSError as error:
            self._take_back()
            raise AppendFailed(f"{segment.path}: nothing can be appended at byte {segment.size}: {error}") from error
        if written != len(data):
            self._take_back()
            raise AppendFailed(f"{segment.path}: {written} of {len(data)} bytes appended: the disk is full")
        segment.size += written

    def _take_back(self) -> None:
        with contextlib.suppress(OSError):  # what is left behind has no whole record, and is read over
            os.ftruncate(self._handle, self.segment.size)

    def sync(self, size: int) -> None:
        """The first `size` bytes outlive a loss of power. Raises AppendFailed."""
        try:
            os.fsync(self._handle)
            if not self._is_listed:
                sync_folder(self.segment.path.parent)
        except OSError as error:
            raise AppendFailed(f"{self.segment.path}: cannot be fsynced: {error}") from error
        self._is_listed = True
        self.segment.durable = size

    def close(self) -> None:
        """No more is appended."""
        os.close(self._handle)
