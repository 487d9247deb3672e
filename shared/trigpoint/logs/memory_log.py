"""The event log's twin in memory: the same answers, nothing kept beyond the process."""

import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from trigpoint.errors import TrigpointError
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, LogPosition
from trigpoint.events.runs import EncodedRun, LoggedRun, encoded, envelopes
from trigpoint.logs.absences import Absence
from trigpoint.logs.channels import packed_rows
from trigpoint.logs.log_files import valid_stream
from trigpoint.logs.ports import AppendedTogether, LoggedBoot, LoggedEvent


class MemoryLog:
    """An EventLog that keeps its streams in lists."""

    def __init__(self) -> None:
        self._streams: dict[str, list[Envelope[Event]]] = {}
        self._lock = threading.Lock()

    def append(self, stream: str, rows: Sequence[Envelope[Event] | EncodedRun]) -> LogPosition:
        """The position of the last row. Raises InputError for a name, stamp or sequence no file could hold."""
        valid_stream(stream)
        if rows:
            packed_rows(rows)
        events = [event for row in rows for event in (envelopes(row) if isinstance(row, EncodedRun) else (row,))]
        with self._lock:
            kept = self._streams.setdefault(stream, [])
            kept.extend(events)
            return LogPosition(stream, len(kept) - 1)

    def append_all(self, rows_by_stream: Mapping[str, Sequence[Envelope[Event] | EncodedRun]]) -> AppendedTogether:
        """Of each stream what `append` gives or raises."""
        positions, failures = {}, {}
        for stream, rows in rows_by_stream.items():
            try:
                positions[stream] = self.append(stream, rows)
            except TrigpointError as error:
                failures[stream] = error
        return AppendedTogether(positions, failures)

    def read(
        self,
        stream: str,
        *,
        first_number: int = 0,
        from_ns: int | None = None,
        until_ns: int | None = None,
        kinds: Sequence[type] | None = None,
    ) -> Iterator[LoggedEvent]:
        """The events that were in the stream when reading began, filtered as EventLog says."""
        with self._lock:
            rows = self._streams.get(stream, [])[first_number:]
        for number, row in enumerate(rows, start=first_number):
            early = from_ns is not None and row.stamp_ns < from_ns
            late = until_ns is not None and row.stamp_ns >= until_ns
            if not early and not late and (kinds is None or isinstance(row.event, tuple(kinds))):
                yield LoggedEvent(LogPosition(stream, number), row)

    def read_runs(
        self, stream: str, *, first_number: int = 0, kinds: Sequence[type] | None = None
    ) -> Iterator[LoggedRun]:
        """What `read` gives, each a run of one."""
        for row in self.read(stream, first_number=first_number, kinds=kinds):
            yield LoggedRun(row.position, encoded(row.envelope))

    def read_headers(self, stream: str) -> Iterator[EncodedRun]:
        """Identities, schemas and times of the events that are there, each a run of one."""
        for row in self.read(stream):
            yield replace(encoded(row.envelope), payloads=())

    def streams(self) -> tuple[str, ...]:
        """The names of all streams that hold an event, sorted."""
        with self._lock:
            return tuple(sorted(stream for stream, rows in self._streams.items() if rows))

    def next_number(self, stream: str) -> int:
        """The number the next appended event will get."""
        return len(self._streams.get(stream, []))

    def begins_at(self, stream: str) -> int:
        """The number of the oldest event: 0, since nothing is ever taken away."""
        return 0

    def absences(self, stream: str) -> tuple[Absence, ...]:
        """Nothing: nothing is ever taken away."""
        return ()

    def boots(self, stream: str) -> tuple[LoggedBoot, ...]:
        """The boots with events in a stream, in order of time."""
        with self._lock:
            rows = list(self._streams.get(stream, []))
        stamps_ns: dict[tuple[str, str], list[int]] = {}
        for row in rows:
            stamps_ns.setdefault((row.identity.source, row.identity.boot_id), []).append(row.stamp_ns)
        boots = [LoggedBoot(*drive, min(stamps), max(stamps)) for drive, stamps in stamps_ns.items()]
        return tuple(sorted(boots, key=lambda boot: (boot.start_ns, boot.source, boot.boot_id)))

    def close(self) -> None:
        """Nothing to flush; what was appended stays readable."""
