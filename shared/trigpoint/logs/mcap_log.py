"""The event log in MCAP files: `<directory>/<stream>/<first number>.mcap`, and a catalog of them beside."""

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

from trigpoint.errors import LogDamaged
from trigpoint.events.codec import Event, decode, event_class
from trigpoint.events.envelope import Envelope, LogPosition
from trigpoint.events.keys import DEFAULT_MAP, STREAM_PATTERNS
from trigpoint.events.observed import MapFramePinned, VehicleDescribed
from trigpoint.events.runs import EncodedRun, LoggedRun
from trigpoint.logs.absences import NAME as ABSENCES_NAME
from trigpoint.logs.absences import Absence, recorded_absences
from trigpoint.logs.append_together import append_together
from trigpoint.logs.catalog import NAME, Catalog, CatalogChunk, CatalogFile, FileContents, renewed_once
from trigpoint.logs.channels import ChannelKey, packed_rows
from trigpoint.logs.chunk_reading import chunk_data, opened, taken_away
from trigpoint.logs.chunks import messages
from trigpoint.logs.headers import chunk_headers, chunk_runs, index_bytes
from trigpoint.logs.log_files import bring_up_to_date, file_path, has_writer, valid_stream
from trigpoint.logs.ports import AppendedTogether, LoggedBoot, LoggedEvent
from trigpoint.logs.stream_writer import Rotation, StreamWriter

DEFAULT_ROTATION = Rotation()
SYNC_THREADS = 16  # streams that wait for the disk at the same time: one journal commit serves them all
AnswerT = TypeVar("AnswerT")
ChunkRecords = tuple[CatalogChunk, bytes, bytes, dict[int, ChannelKey]]
Mark = tuple[int, int]  # a stream's last file and when, in ns, files came or went


@dataclass(slots=True)
class ReadCounts:
    """How many files were opened and chunks decompressed for reading, since the log was opened."""

    files: int = 0
    chunks: int = 0


@dataclass(frozen=True, slots=True)
class _Wanted:
    """What of a stream is to be read."""

    first_number: int
    from_ns: int | None
    until_ns: int | None
    kinds: frozenset[type] | None

    def channels(self, known: Mapping[int, ChannelKey]) -> dict[int, ChannelKey]:
        """Those of the channels whose events are wanted."""
        kinds = self.kinds
        if kinds is None:
            return dict(known)
        return {number: key for number, key in known.items() if event_class(key.schema_name) in kinds}

    def holds(self, number: int, stamp_ns: int) -> bool:
        """Whether an event of this number and time is wanted."""
        early = self.from_ns is not None and stamp_ns < self.from_ns
        late = self.until_ns is not None and stamp_ns >= self.until_ns
        return number >= self.first_number and not early and not late


class McapLog:
    """An EventLog on disk. Any number of readers, in any process; a stream's first append makes this its writer."""

    def __init__(
        self,
        directory: Path,
        *,
        rotation: Rotation = DEFAULT_ROTATION,
        software: str = "trigpoint",
        map_name: str = DEFAULT_MAP,
    ) -> None:
        directory.mkdir(parents=True, exist_ok=True)
        self.directory = directory
        self.read_counts = ReadCounts()
        self._rotation, self._software = rotation, software
        self._map = {"name": map_name}
        self._catalog = Catalog(directory / NAME)
        self._absences: dict[str, tuple[Mark, tuple[Absence, ...]]] = {}
        self._marks: dict[str, Mark | None] = {}
        self._writers: dict[str, StreamWriter] = {}
        self._append_locks: dict[str, threading.Lock] = {}
        self._lock = threading.RLock()
        self._syncing = ThreadPoolExecutor(SYNC_THREADS, thread_name_prefix="fsync")
        try:
            renewed_once(self._bring_all_up_to_date)
        except BaseException:
            self._catalog.close()
            raise

    def describe(self, frame: MapFramePinned) -> None:
        """Files begun from now on name the map's frame in their metadata."""
        origin = {"origin_easting_m": repr(frame.origin_easting_m), "origin_northing_m": repr(frame.origin_northing_m)}
        self._map = {"name": self._map["name"], "crs": frame.crs, **origin}

    def append(self, stream: str, rows: Sequence[Envelope[Event] | EncodedRun]) -> LogPosition:
        """The position of the last row (of the last event there, without rows), once all rows are durable.

        Raises AppendFailed if they cannot be made so or another process writes the stream, InputError for a name,
        stamp or sequence no log can hold, EventRejected for a value its schema cannot hold.
        """
        valid_stream(stream)
        with self._append_lock(stream):  # one stream waits for its disk while others pack
            ready = packed_rows(rows) if rows else None
            writer = self._writer(stream)
            if ready:
                with self._forgotten_if_let_go((stream,)):
                    writer.append(ready, self._metadata(stream, ready.channels[0].vehicle))
            return LogPosition(stream, writer.next_number - 1)

    def append_all(self, rows_by_stream: Mapping[str, Sequence[Envelope[Event] | EncodedRun]]) -> AppendedTogether:
        """Of each stream what `append` gives or raises; they wait for the disk at the same time."""
        with ExitStack() as held:
            for stream in sorted(rows_by_stream):
                held.enter_context(self._append_lock(stream))
            writes = {stream: partial(self._write, stream, rows) for stream, rows in rows_by_stream.items()}
            with self._forgotten_if_let_go(tuple(rows_by_stream)):
                failures = append_together(self._catalog, writes, self._syncing)
            done = [stream for stream in rows_by_stream if stream not in failures]
            positions = {stream: LogPosition(stream, self._writers[stream].next_number - 1) for stream in done}
            return AppendedTogether(positions, failures)

    def _write(self, stream: str, rows: Sequence[Envelope[Event] | EncodedRun]) -> StreamWriter:
        ready, writer = packed_rows(rows), self._writer(valid_stream(stream))
        writer.write(ready, self._metadata(stream, ready.channels[0].vehicle))
        return writer

    @contextmanager
    def _forgotten_if_let_go(self, streams: Sequence[str]) -> Iterator[None]:
        try:
            yield
        finally:
            for stream in streams:
                if stream in self._writers and self._writers[stream].is_let_go:
                    del self._writers[stream]

    def _append_lock(self, stream: str) -> threading.Lock:
        with self._lock:
            return self._append_locks.setdefault(stream, threading.Lock())

    def _writer(self, stream: str) -> StreamWriter:
        if stream not in self._writers:
            self._writers[stream] = StreamWriter(self.directory / stream, self._catalog, rotation=self._rotation)
        return self._writers[stream]

    def _metadata(self, stream: str, vehicle: str) -> dict[str, dict[str, str]]:
        records = {"software": {"name": self._software}, "map": self._map}
        own = STREAM_PATTERNS[VehicleDescribed].format(vehicle=vehicle)
        return records | ({"vehicle": {"name": vehicle}} if stream == own else {})

    def read(
        self,
        stream: str,
        *,
        first_number: int = 0,
        from_ns: int | None = None,
        until_ns: int | None = None,
        kinds: Sequence[type] | None = None,
    ) -> Iterator[LoggedEvent]:
        """The events that were durable when reading began, filtered as EventLog says.

        Raises LogDamaged where a chunk is damaged, after everything before it.
        """
        wanted = _Wanted(first_number, from_ns, until_ns, frozenset(kinds) if kinds is not None else None)
        for first, chunks in self._chunks_by_file(stream, wanted):
            yield from self._read_file(stream, first, chunks, wanted)

    def read_headers(self, stream: str) -> Iterator[EncodedRun]:
        """Identities and times of all events that were durable when reading began, in order; no payload is decoded.

        Raises LogDamaged as `read` does.
        """
        for chunk, data, indexes, channels in self._chunk_records(stream, _Wanted(0, None, None, None)):
            yield from chunk_headers(data, indexes, chunk.count, channels)

    def read_runs(
        self, stream: str, *, first_number: int = 0, kinds: Sequence[type] | None = None
    ) -> Iterator[LoggedRun]:
        """What `read` gives, many events at once and none decoded. Raises LogDamaged as `read` does."""
        wanted = _Wanted(first_number, None, None, frozenset(kinds) if kinds is not None else None)
        for chunk, data, indexes, channels in self._chunk_records(stream, wanted):
            for place, run in chunk_runs(data, indexes, chunk.count, channels):
                found = LoggedRun(LogPosition(stream, chunk.number + place), run)
                if found.next_number > first_number:
                    yield found.part(max(0, first_number - found.position.number), len(run))

    def _chunk_records(self, stream: str, wanted: _Wanted) -> Iterator[ChunkRecords]:
        """The chunks that may hold what is wanted, with their records, their message indexes and wanted channels."""
        for first, chunks in self._chunks_by_file(stream, wanted):
            channels = wanted.channels(self._channels(stream, first, chunks))
            path = file_path(self.directory / stream, first)
            with opened(path, chunks) as file:
                for chunk in chunks:
                    if channels.keys().isdisjoint(chunk.channel_ids):
                        continue
                    data = chunk_data(file, path, chunk)
                    yield chunk, data, file.read(index_bytes(chunk.count, len(chunk.channel_ids))), channels

    def _chunks_by_file(self, stream: str, wanted: _Wanted) -> Iterator[tuple[int, list[CatalogChunk]]]:
        """The files with chunks that may hold what is wanted; LogDamaged raised behind the first damaged one."""
        chunks, damages = self._asked(
            stream,
            lambda catalog: (
                catalog.chunks(
                    stream, first_number=wanted.first_number, from_ns=wanted.from_ns, until_ns=wanted.until_ns
                ),
                _damages(catalog.files(stream), wanted.first_number),
            ),
        )
        by_file: dict[int, list[CatalogChunk]] = {}
        for chunk in chunks:
            by_file.setdefault(chunk.first_number, []).append(chunk)
        for first in sorted(by_file.keys() | damages.keys()):
            if first in by_file:
                yield first, by_file[first]
            if first in damages:
                raise LogDamaged(damages[first])

    def _read_file(
        self, stream: str, first_number: int, chunks: Sequence[CatalogChunk], wanted: _Wanted
    ) -> Iterator[LoggedEvent]:
        channels = wanted.channels(self._channels(stream, first_number, chunks))
        needed = [chunk for chunk in chunks if not channels.keys().isdisjoint(chunk.channel_ids)]
        if not needed:
            return
        path = file_path(self.directory / stream, first_number)
        with opened(path, needed) as file:
            self.read_counts.files += 1
            for chunk in needed:
                self.read_counts.chunks += 1
                yield from _events(chunk_data(file, path, chunk), stream, chunk.number, channels, wanted)

    def _channels(self, stream: str, first_number: int, chunks: Sequence[CatalogChunk]) -> dict[int, ChannelKey]:
        """The channels of a file with these chunks. Raises LogDamaged where the file is gone since they were read."""
        known = self._asked(stream, lambda catalog: catalog.channels(stream, first_number))
        if not known.keys() >= {channel_id for chunk in chunks for channel_id in chunk.channel_ids}:
            raise taken_away(file_path(self.directory / stream, first_number), chunks)
        return known

    def streams(self) -> tuple[str, ...]:
        """The names of all streams that hold an event, or held one that is recorded as gone, sorted."""
        return renewed_once(self._streams)

    def next_number(self, stream: str) -> int:
        """The number the next appended event will get; 0 for an unknown stream."""
        absent = max((absence.stop_number for absence in self.absences(stream)), default=0)
        return max(self._asked(stream, lambda catalog: catalog.next_number(stream)), absent)

    def begins_at(self, stream: str) -> int:
        """The number of the oldest event of a stream; what came before it is retained away or lost."""
        first = self._asked(stream, lambda catalog: catalog.first_number(stream))
        return self.next_number(stream) if first is None else first

    def absences(self, stream: str) -> tuple[Absence, ...]:
        """What of a stream is not there any more, and why, by number. Raises LogDamaged where the record is."""
        folder = self.directory / valid_stream(stream)
        try:
            state = (folder / ABSENCES_NAME).stat()
        except FileNotFoundError:
            return ()
        mark = (state.st_ino, state.st_mtime_ns)
        if stream not in self._absences or self._absences[stream][0] != mark:
            self._absences[stream] = (mark, recorded_absences(folder))
        return self._absences[stream][1]

    def end_aged(self, now_ns: int) -> tuple[str, ...]:
        """The streams whose file was ended because it was open for the rotation's age. Raises AppendFailed."""
        with self._lock:
            open_streams = [(stream, self._append_locks[stream]) for stream in self._writers]
        ended = []
        for stream, own in open_streams:
            with own:
                if stream in self._writers and self._end_aged(stream, now_ns):
                    ended.append(stream)
        return tuple(ended)

    def written_streams(self) -> tuple[str, ...]:
        """The streams this log is the writer of, sorted."""
        with self._lock:
            return tuple(sorted(self._writers))

    def end_abandoned(self) -> tuple[str, ...]:
        """Every file ended that no writer has open, all streams then let go; the streams that are being written.

        Raises LogDamaged, AppendFailed as appending does.
        """
        written = []
        for stream in self.streams():
            if has_writer(self.directory / stream):
                written.append(stream)
            elif not all(contents.file.finished for contents in self.contents(stream)):
                self.append(stream, ())
        with self._lock:
            for stream in [stream for stream in self._writers if stream not in written]:
                self._writers.pop(stream).close()
        return tuple(written)

    def _end_aged(self, stream: str, now_ns: int) -> bool:
        try:
            return self._writers[stream].end_aged(now_ns)
        except BaseException:
            del self._writers[stream]
            raise

    def boots(self, stream: str) -> tuple[LoggedBoot, ...]:
        """The boots with events in a stream, in order of time, from the catalog; to within the chunks they are in."""
        return tuple(LoggedBoot(*boot) for boot in self._asked(stream, lambda catalog: catalog.boots(stream)))

    def contents(self, stream: str) -> tuple[FileContents, ...]:
        """What each file of a stream holds, from the catalog."""
        return self._asked(stream, lambda catalog: catalog.contents(stream))

    def close(self) -> None:
        """All files ended with their index, all streams let go. Raises AppendFailed if that cannot be written."""
        with self._lock, ExitStack() as closing:  # each one is closed, whatever becomes of the others
            closing.callback(self._catalog.close)
            closing.callback(self._syncing.shutdown)
            while self._writers:
                closing.callback(self._writers.popitem()[1].close)

    def _asked(self, stream: str, question: Callable[[Catalog], AnswerT]) -> AnswerT:
        """The answer of a catalog that knows the stream's files."""

        def answered() -> AnswerT:
            self._bring_up_to_date(stream)
            return question(self._catalog)

        return renewed_once(answered)

    def _streams(self) -> tuple[str, ...]:
        there = self._bring_all_up_to_date()
        held = set(self._catalog.streams())
        emptied = {stream for stream in there - held if (self.directory / stream / ABSENCES_NAME).exists()}
        return tuple(sorted(held | emptied))

    def _bring_up_to_date(self, stream: str) -> None:
        """The catalog knows the stream's files: looked at again only where one came, went, or the last one grew."""
        folder = self.directory / valid_stream(stream)
        last = self._catalog.last_file(stream)
        if self._mark(folder, last) is None or self._marks.get(stream) != self._mark(folder, last):
            bring_up_to_date(self._catalog, folder, stream)
            self._marks[stream] = self._mark(folder, self._catalog.last_file(stream))

    def _mark(self, folder: Path, last: CatalogFile | None) -> Mark | None:
        """What tells that a stream is as it was when looked at; None where it has to be looked at."""
        try:
            size_bytes = file_path(folder, last.first_number).stat().st_size if last else 0
            changed_ns = folder.stat().st_mtime_ns
        except FileNotFoundError:
            return None
        return (last.first_number, changed_ns) if last and size_bytes == last.size_bytes else None

    def _bring_all_up_to_date(self) -> set[str]:
        """The streams that have a folder; the catalog knows all their files."""
        there = {path.name for path in self.directory.iterdir() if path.is_dir() and not path.name.startswith(".")}
        for stream in sorted(there | set(self._catalog.streams())):
            self._bring_up_to_date(stream)
        return there


def _damages(files: Sequence[CatalogFile], number: int) -> dict[int, str]:
    """Of each damaged file of a stream that may hold this number or later ones, what is wrong."""
    ends = [*(file.first_number for file in files[1:]), number + 1]
    return {
        file.first_number: file.damage
        for file, end in zip(files, ends, strict=False)  # no file, no end: an unknown stream holds nothing
        if file.damage and end > number
    }


def _events(
    data: bytes, stream: str, number: int, channels: Mapping[int, ChannelKey], wanted: _Wanted
) -> Iterator[LoggedEvent]:
    """The wanted ones among the events of a chunk; the first has this number."""
    for index, (channel_id, sequence, stamp_ns, payload, _) in enumerate(messages(data), start=number):
        key = channels.get(channel_id)
        if key is not None and wanted.holds(index, stamp_ns):
            envelope = Envelope(key.identity(sequence), stamp_ns, decode(key.schema_name, payload))
            yield LoggedEvent(LogPosition(stream, index), envelope)
