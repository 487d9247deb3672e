"""What a log can do, whatever keeps it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from trigpoint.errors import TrigpointError
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, LogPosition
from trigpoint.events.runs import EncodedRun, LoggedRun
from trigpoint.logs.absences import Absence


@dataclass(frozen=True, slots=True)
class LoggedEvent:
    """An event and where it stands in the log."""

    position: LogPosition
    envelope: Envelope[Event]


@dataclass(frozen=True, slots=True)
class LoggedBoot:
    """One boot of a source in a stream: all its events are of the closed time range [start_ns, end_ns]."""

    source: str
    boot_id: str
    start_ns: int
    end_ns: int


@dataclass(frozen=True, slots=True)
class AppendedTogether:
    """Of several streams the positions of their last rows, and of the others what their appends failed with."""

    positions: Mapping[str, LogPosition]
    failures: Mapping[str, TrigpointError]


class EventLog(Protocol):
    """Append-only streams of events; one writer a stream."""

    def append(self, stream: str, rows: Sequence[Envelope[Event] | EncodedRun]) -> LogPosition:
        """The position of the last row, once all rows are durable; a run is as many rows as it holds, kept as the
        bytes it has. Raises AppendFailed."""

    def read(
        self,
        stream: str,
        *,
        first_number: int = 0,
        from_ns: int | None = None,
        until_ns: int | None = None,
        kinds: Sequence[type] | None = None,
    ) -> Iterator[LoggedEvent]:
        """The events of a stream from `first_number` on, in order of appending; of the half-open time range
        [from_ns, until_ns) and of the given event classes only, if given: files and chunks outside stay closed."""

    def read_runs(
        self, stream: str, *, first_number: int = 0, kinds: Sequence[type] | None = None
    ) -> Iterator[LoggedRun]:
        """What `read` gives, many events at once and none decoded."""

    def streams(self) -> tuple[str, ...]:
        """The names of all streams, sorted."""

    def next_number(self, stream: str) -> int:
        """The number the next appended event will get; 0 for an unknown stream."""

    def begins_at(self, stream: str) -> int:
        """The number of the oldest event of a stream: not 0 where older ones were retained away; the next number
        where there is none."""

    def absences(self, stream: str) -> tuple[Absence, ...]:
        """What of a stream is not there any more, and why, by number. Raises LogDamaged where that record is."""

    def boots(self, stream: str) -> tuple[LoggedBoot, ...]:
        """The boots with events in a stream, in order of time; no event is read for it, and the range may be wider than
        the events'."""

    def close(self) -> None:
        """Everything flushed, files closed with their index."""


class RecallingLog(EventLog, Protocol):
    """An EventLog that also tells who said what when without a look at what was said, and takes groups of events."""

    def append_all(self, rows_by_stream: Mapping[str, Sequence[Envelope[Event] | EncodedRun]]) -> AppendedTogether:
        """Of each stream, with a row at least, what `append` gives or raises: side by side, not one by one."""

    def read_headers(self, stream: str) -> Iterator[EncodedRun]:
        """Identities, schemas and times of all events of a stream, in order, as runs without payloads."""
