"""Follows streams of a log as they grow: what is new since a checkpoint, in order, each event once."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice
from types import MappingProxyType

from trigpoint.errors import TrigpointError
from trigpoint.events.runs import LoggedRun
from trigpoint.logs.ports import EventLog, LoggedEvent

UNBOUNDED_BYTES = 2**63
Wanted = Callable[[str], bool]


class StreamFollower:
    """The events of some streams that were not taken yet. Not for several threads.

    A stream that appears later is followed from its beginning. Nothing is decoded twice, and a look at a log
    without news costs a few file states and look-ups in its catalog.
    """

    def __init__(
        self,
        log: EventLog,
        streams: Wanted | Sequence[str],
        *,
        checkpoint: Mapping[str, int] = MappingProxyType({}),
        kinds: Sequence[type] | None = None,
    ) -> None:
        """`streams`: names, or which names; `checkpoint`: the next number of each stream that was followed before;
        `kinds`: the classes of events wanted, others are passed over."""
        self._log, self._kinds = log, kinds
        self._wanted: Wanted = streams if callable(streams) else frozenset(streams).__contains__
        self._next = dict(checkpoint)
        self._readings: dict[str, tuple[Iterator[LoggedEvent], int]] = {}  # and the number they reach at least
        self._error: Exception | None = None  # to be raised by the next take
        self._turn: list[str] = []  # streams, the one longest not served first

    @property
    def checkpoint(self) -> Mapping[str, int]:
        """By stream the number after the last event taken or passed over: where another follower goes on."""
        return dict(self._next)

    @property
    def lag(self) -> int:
        """How many events stand in the log that were not taken, those of other kinds included."""
        return sum(self._log.next_number(stream) - self._next.get(stream, 0) for stream in self._streams())

    def take(self, limit: int) -> list[LoggedEvent]:
        """At most so many new events, in order within each stream; none if there is nothing new.

        Streams come one after the other, and where `limit` cuts, those left out come first the next time. Raises
        LogDamaged as reading does, once everything before the damage was taken; the next take goes on with the others.
        """
        if self._error is not None:
            error, self._error = self._error, None
            raise error
        taken: list[LoggedEvent] = []
        for stream in self._in_turn():
            if len(taken) == limit or self._error is not None:
                break
            self._turn.remove(stream)
            self._turn.append(stream)
            self._take(stream, limit, taken)
        if self._error is not None and not taken:
            return self.take(limit)
        return taken

    def _streams(self) -> tuple[str, ...]:
        return tuple(stream for stream in self._log.streams() if self._wanted(stream))

    def _in_turn(self) -> tuple[str, ...]:
        there = self._streams()
        self._turn += [stream for stream in there if stream not in self._turn]
        return tuple(stream for stream in self._turn if stream in there)

    def _take(self, stream: str, limit: int, taken: list[LoggedEvent]) -> None:
        """Up to `limit` events in `taken` altogether; an error is kept, so that none of them is lost by it."""
        reading = self._reading(stream)
        if reading is None:
            return
        rows, end = reading
        try:
            for row in islice(rows, limit - len(taken)):
                taken.append(row)
                self._next[stream] = row.position.number + 1
        except (TrigpointError, OSError) as error:
            self._error = error
        if len(taken) < limit:  # read to its end
            del self._readings[stream]
            if self._error is None:
                self._next[stream] = max(end, self._next.get(stream, 0))

    def _reading(self, stream: str) -> tuple[Iterator[LoggedEvent], int] | None:
        """What is being read of a stream, begun anew where there is more; None if there is nothing new."""
        if stream not in self._readings:
            first, end = self._next.get(stream, 0), self._log.next_number(stream)
            if end <= first:
                return None
            self._readings[stream] = (self._log.read(stream, first_number=first, kinds=self._kinds), end)
        return self._readings[stream]


class RunFollower:
    """The events of one stream that were not taken yet, from `first_number` on, undecoded. Not for several threads."""

    def __init__(self, log: EventLog, stream: str, *, first_number: int = 0, kinds: Sequence[type] | None = None):
        self._log, self._stream, self._kinds = log, stream, kinds
        self._next = first_number
        self._reading: Iterator[LoggedRun] | None = None
        self._end = first_number  # which it reaches at least
        self._left: LoggedRun | None = None  # of what was read
        self._error: Exception | None = None  # to be raised by the next take

    @property
    def is_behind(self) -> bool:
        """Whether the last take left something that was there when it began to read."""
        return self._reading is not None or self._left is not None

    def take(self, limit: int, *, limit_bytes: int = UNBOUNDED_BYTES) -> list[LoggedRun]:
        """At most so many new events, in order; fewer where payloads add up to `limit_bytes`, none if there is nothing
        new.

        Raises LogDamaged as reading does, once everything before the damage was taken.
        """
        taken: list[LoggedRun] = []
        wanted, taken_bytes = limit, 0
        while wanted and taken_bytes < limit_bytes and (row := self._following()) is not None:
            part = row if len(row.run) <= wanted else row.part(0, wanted)
            self._left = row.part(wanted, len(row.run)) if len(row.run) > wanted else None
            self._next = part.next_number
            wanted -= len(part.run)
            taken_bytes += sum(map(len, part.run.payloads))
            taken.append(part)
        if self._error is not None and not taken:
            error, self._error = self._error, None
            raise error
        return taken

    def _following(self) -> LoggedRun | None:
        """The next run, None at the end and where an error is to be raised."""
        if self._left is not None or self._error is not None:
            return self._left
        if self._reading is None:
            self._end = max(self._next, self._log.next_number(self._stream))
            if self._end == self._next:
                return None
            self._reading = self._log.read_runs(self._stream, first_number=self._next, kinds=self._kinds)
        try:
            found = next(self._reading, None)
        except (TrigpointError, OSError) as error:
            self._error, self._reading = error, None
            return None
        if found is None:  # read to its end
            self._next, self._reading = max(self._end, self._next), None
        return found
