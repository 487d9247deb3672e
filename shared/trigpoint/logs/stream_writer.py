"""The one writer of a stream: holds its lock, appends durably, begins a new file where one is long enough."""

import contextlib
import fcntl
import os
import sqlite3
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import FileIO
from pathlib import Path

from trigpoint.durable_files import sync_folder
from trigpoint.errors import AppendFailed
from trigpoint.logs.absences import recorded_absences
from trigpoint.logs.catalog import (
    Catalog,
    CatalogChunk,
    CatalogEntry,
    CatalogFile,
    CatalogGrowth,
    CatalogRenewed,
    renewed_once,
)
from trigpoint.logs.channels import PackedRows
from trigpoint.logs.log_files import LOCK_NAME, bring_up_to_date, entry_of, file_path, mend
from trigpoint.logs.mcap_writer import CHANNEL_LIMIT, McapFileWriter, WrittenChunk

LOCK_TRIES, LOCK_PAUSE_S = 25, 0.01  # a reader that asks whether there is a writer has the lock for microseconds
FILE_BYTES = 64 * 1024 * 1024  # small enough to copy and to rescan in about a second
FILE_SPAN_NS = 3_600_000_000_000  # an hour of measurements
FILE_AGE_NS = 24 * FILE_SPAN_NS  # a day: a quiet stream's events are sealed and can be backed up at last
SPAN_LEAST_BYTES = 1024 * 1024  # drives of different years in one stream must not make a file an append


@dataclass(frozen=True, slots=True)
class Rotation:
    """When a file is long enough: by its bytes, or, from `span_least_bytes` on, by the time its measurements span, or,
    where somebody asks, by how long it was open."""

    size_bytes: int = FILE_BYTES
    span_ns: int = FILE_SPAN_NS
    span_least_bytes: int = SPAN_LEAST_BYTES
    age_ns: int = FILE_AGE_NS


@dataclass(slots=True)
class _OpenFile:
    """The file a stream is at, and what of it is durable."""

    first_number: int
    file: FileIO
    writer: McapFileWriter
    start_ns: int
    end_ns: int
    is_listed: bool = False  # whether its folder is known to hold it after a loss of power
    channels_known: int = 0
    durable_bytes: int = 0  # and entered in the catalog
    written: Sequence[WrittenChunk] = ()  # behind them
    seen_ns: int | None = None  # when its age was first asked for


class StreamWriter:
    """Appends to one stream; exists once per stream among all processes."""

    def __init__(self, folder: Path, catalog: Catalog, *, rotation: Rotation) -> None:
        """The stream claimed and what a crash left of it mended.

        Raises AppendFailed if another writer has it, LogDamaged if it cannot be mended without loss.
        """
        self._folder, self._catalog, self._rotation = folder, catalog, rotation
        self._open_file: _OpenFile | None = None
        self._lock = _locked(folder)
        try:
            self.next_number = renewed_once(self._taken_over)
        except (OSError, sqlite3.Error) as error:
            self._lock.close()
            raise AppendFailed(f"stream {folder.name}: not mended: {error}") from error
        except BaseException:
            self._lock.close()
            raise

    def _taken_over(self) -> int:
        """The next number, after all files were read and mended."""
        bring_up_to_date(self._catalog, self._folder, self._folder.name, alone=True)
        mend(self._catalog, self._folder, self._folder.name)
        absent = max((absence.stop_number for absence in recorded_absences(self._folder)), default=0)
        return max(self._catalog.next_number(self._folder.name), absent)

    def append(self, rows: PackedRows, metadata: Mapping[str, Mapping[str, str]]) -> None:
        """The rows durable. Raises AppendFailed and lets the stream go; nothing of them counts as appended then,
        unless it was only the end of a full file that could not be written. Each step below raises the same."""
        self.write(rows, metadata)
        self.sync()
        self.enter()
        self.settle()

    def write(self, rows: PackedRows, metadata: Mapping[str, Mapping[str, str]]) -> None:
        """The rows with the operating system: the first step of an append."""
        with self._or_let_go():
            target = self._open_file or self._begin(int(rows.stamps_ns[0]), metadata)
            target.written = target.writer.append(rows)

    def sync(self) -> None:
        """What was written is durable: the second step, which may be another thread's."""
        with self._or_let_go():
            os.fsync(self._target.file.fileno())
            if not self._target.is_listed:
                sync_folder(self._folder)
                sync_folder(self._folder.parent)
                self._target.is_listed = True

    def growth(self) -> CatalogGrowth:
        """What the catalog is to be told of what was written, in the third step."""
        target, number, entered = self._target, self.next_number, []
        for chunk in target.written:
            place = (chunk.start_ns, chunk.end_ns, chunk.offset, chunk.length)
            entered.append(CatalogChunk(target.first_number, number, chunk.count, *place, chunk.channel_ids))
            number += chunk.count
        channels = [(number, key) for key, number in target.writer.channels.items() if number > target.channels_known]
        state = self._state(target, finished=False)
        return CatalogGrowth(CatalogEntry(state, tuple(entered), tuple(channels)), target.durable_bytes)

    def enter(self) -> None:
        """What was written is in the catalog: the third step, where it is not taken for several streams as one."""
        with self._or_let_go():
            self._add(self.growth())

    def settle(self) -> None:
        """What was written counts as appended, and a file that is long enough is ended: the last step."""
        target = self._target
        for chunk in target.written:
            self.next_number += chunk.count
            target.start_ns = min(target.start_ns, chunk.start_ns)
            target.end_ns = max(target.end_ns, chunk.end_ns)
        target.written = ()
        target.channels_known = len(target.writer.channels)
        target.durable_bytes = target.writer.size_bytes
        if self._is_long_enough(target):
            with self._or_let_go():
                self._end(target)

    @property
    def _target(self) -> _OpenFile:
        if self._open_file is None:
            raise AppendFailed(f"stream {self._folder.name}: nothing was written")
        return self._open_file

    @contextlib.contextmanager
    def _or_let_go(self) -> Iterator[None]:
        try:
            yield
        except (OSError, sqlite3.Error) as error:
            raise self.refused(error) from error
        except BaseException:
            self.let_go()
            raise

    def refused(self, error: Exception) -> AppendFailed:
        """What is to be raised for an append that came to this; the stream is let go."""
        self.let_go()
        failed = AppendFailed(f"stream {self._folder.name}, number {self.next_number}: {error}")
        failed.__cause__ = error
        return failed

    def end_aged(self, now_ns: int) -> bool:
        """Whether the file was ended, because it was open for the rotation's age; its age counts from the first look.

        Raises AppendFailed and lets the stream go if it cannot be ended.
        """
        target = self._open_file
        if target is None:
            return False
        if target.seen_ns is None:
            target.seen_ns = now_ns
        if now_ns - target.seen_ns < self._rotation.age_ns:
            return False
        try:
            self._end(target)
        except (OSError, sqlite3.Error) as error:
            self.let_go()
            raise AppendFailed(f"stream {self._folder.name}: file not ended: {error}") from error
        return True

    def close(self) -> None:
        """The file ended with its summary, the stream let go. Raises AppendFailed if that cannot be written."""
        try:
            if self._open_file:
                self._end(self._open_file)
        except (OSError, sqlite3.Error) as error:
            self.let_go()
            raise AppendFailed(f"stream {self._folder.name}: last file not ended: {error}") from error
        self._lock.close()

    def _begin(self, stamp_ns: int, metadata: Mapping[str, Mapping[str, str]]) -> _OpenFile:
        file = file_path(self._folder, self.next_number).open("xb", buffering=0)
        writer = McapFileWriter(file, metadata=metadata)
        self._open_file = _OpenFile(self.next_number, file, writer, stamp_ns, stamp_ns)
        begun = CatalogFile(self._folder.name, self.next_number, 0, finished=False)
        renewed_once(lambda: self._catalog.replace(CatalogEntry(begun, (), ())))
        return self._open_file

    def _add(self, growth: CatalogGrowth) -> None:
        """The growth in the catalog; if that was begun anew, everything the file holds."""
        try:
            self._catalog.add_all([growth])
        except CatalogRenewed:
            whole = entry_of(self._folder, self._folder.name, growth.entry.file.first_number)
            renewed_once(lambda: self._catalog.replace(whole))

    def _state(self, target: _OpenFile, *, finished: bool) -> CatalogFile:
        return CatalogFile(self._folder.name, target.first_number, target.writer.size_bytes, finished)

    def _is_long_enough(self, target: _OpenFile) -> bool:
        size_bytes, rotation = target.writer.size_bytes, self._rotation
        spans = target.end_ns - target.start_ns >= rotation.span_ns and size_bytes >= rotation.span_least_bytes
        return size_bytes >= rotation.size_bytes or spans or len(target.writer.channels) >= CHANNEL_LIMIT // 2

    def _end(self, target: _OpenFile) -> None:
        target.writer.finish()
        os.fsync(target.file.fileno())
        target.file.close()
        self._open_file = None
        ended = CatalogEntry(self._state(target, finished=True), (), ())
        self._add(CatalogGrowth(ended, target.durable_bytes))

    @property
    def is_let_go(self) -> bool:
        """Whether nothing can be appended by this writer any more."""
        return self._lock.closed

    def let_go(self) -> None:
        """After a failure: what is not durable cut off, as far as the disk lets us, and the stream let go."""
        target, self._open_file = self._open_file, None
        if target and not target.file.closed:
            with contextlib.suppress(OSError), target.file:
                os.ftruncate(target.file.fileno(), target.durable_bytes)
        self._lock.close()


def _locked(folder: Path) -> FileIO:
    """The stream's lock, held until closed. Raises AppendFailed if another writer holds it or it cannot be taken."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / LOCK_NAME).open("a+b", buffering=0)
    except OSError as error:
        raise AppendFailed(f"stream {folder.name}: {error}") from error
    try:
        _take_lock(lock)
        lock.truncate(0)
        lock.write(str(os.getpid()).encode())
    except BlockingIOError as error:
        lock.seek(0)
        holder = lock.read().decode("ascii", "replace") or "unknown"
        lock.close()
        raise AppendFailed(f"stream {folder.name} has a writer already, process {holder}: one at a time") from error
    except OSError as error:
        lock.close()
        raise AppendFailed(f"stream {folder.name}: not locked: {error}") from error
    return lock


def _take_lock(lock: FileIO) -> None:
    for tries_left in reversed(range(LOCK_TRIES)):
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            if not tries_left:
                raise
            time.sleep(LOCK_PAUSE_S)
