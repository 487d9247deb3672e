"""The log as it was when a map version was solved from it."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import takewhile

from trigpoint.errors import AppendFailed
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, LogPosition
from trigpoint.events.runs import EncodedRun, LoggedRun
from trigpoint.events.solved import SolvedMap
from trigpoint.logs.absences import Absence
from trigpoint.logs.ports import EventLog, LoggedBoot, LoggedEvent


class LogAsOf:
    """An EventLog of the first `count` events of each stream (stream, count), and of no other streams; only read."""

    def __init__(self, log: EventLog, inputs: Sequence[tuple[str, int]]) -> None:
        self._log = log
        self._counts: Mapping[str, int] = dict(inputs)

    def append(self, stream: str, rows: Sequence[Envelope[Event] | EncodedRun]) -> LogPosition:
        """Raises AppendFailed: what was is not added to."""
        raise AppendFailed(f"stream {stream!r}: {len(rows)} rows for a log as it was, which is only read")

    def read(
        self,
        stream: str,
        *,
        first_number: int = 0,
        from_ns: int | None = None,
        until_ns: int | None = None,
        kinds: Sequence[type] | None = None,
    ) -> Iterator[LoggedEvent]:
        """The events there were then, filtered as EventLog says."""
        count = self._counts.get(stream, 0)
        if count > first_number:
            found = self._log.read(stream, first_number=first_number, from_ns=from_ns, until_ns=until_ns, kinds=kinds)
            yield from takewhile(lambda row: row.position.number < count, found)

    def read_runs(
        self, stream: str, *, first_number: int = 0, kinds: Sequence[type] | None = None
    ) -> Iterator[LoggedRun]:
        """What `read` gives, many events at once and none decoded."""
        count = self._counts.get(stream, 0)
        for row in self._log.read_runs(stream, first_number=first_number, kinds=kinds):
            if row.position.number >= count:
                return
            yield row.part(0, min(len(row.run), count - row.position.number))

    def streams(self) -> tuple[str, ...]:
        """The names of the streams that held an event, sorted."""
        return tuple(stream for stream in self._log.streams() if self._counts.get(stream, 0) > 0)

    def next_number(self, stream: str) -> int:
        """The number the next event got, or will get."""
        return min(self._log.next_number(stream), self._counts.get(stream, 0))

    def begins_at(self, stream: str) -> int:
        """The number of the oldest event that is still there, or of the next one that was to come."""
        return min(self._log.begins_at(stream), self._counts.get(stream, 0))

    def absences(self, stream: str) -> tuple[Absence, ...]:
        """What is not there any more of what was there then."""
        count = self._counts.get(stream, 0)
        return tuple(absence for absence in self._log.absences(stream) if absence.first_number < count)

    def boots(self, stream: str) -> tuple[LoggedBoot, ...]:
        """The boots of a stream that had any event then; times as they are now."""
        known = {(row.run.source, row.run.boot_id) for row in self.read_runs(stream)}
        return tuple(boot for boot in self._log.boots(stream) if (boot.source, boot.boot_id) in known)

    def close(self) -> None:
        """Nothing: the log it looks at is closed by whoever opened it."""


def log_as_of(log: EventLog, solved: SolvedMap) -> EventLog:
    """What a map version was solved from; the whole log for a version that does not say how far it read."""
    return LogAsOf(log, solved.head.inputs) if solved.head.inputs else log
