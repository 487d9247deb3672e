"""How far a service is behind the log it follows, in events and in seconds."""

import time
from collections.abc import Callable

from trigpoint.observability.metrics import Instruments

MARKS_LIMIT = 1024  # moments remembered; where there are more, every other one is forgotten, which makes ages longer


class Backlog:
    """Shows what of a log was not taken in yet, and how long the oldest of it has waited since this process saw it.

    What comes while older events wait does not count as old: who is always a few events behind is not ever later.
    """

    def __init__(self, instruments: Instruments, *, now_s: Callable[[], float] = time.monotonic) -> None:
        self._events, self._seconds = instruments.projection_lag_events, instruments.projection_lag_seconds
        self._now_s = now_s
        self._marks: list[tuple[int, float]] = []  # ascending: the events before this number were there at this time

    def show(self, *, taken: int, lag_events: int) -> None:
        """`taken` events, counted from the log's beginning, are taken in, and `lag_events` more are there."""
        now_s, there = self._now_s(), taken + lag_events
        self._marks = [mark for mark in self._marks if taken < mark[0] <= there]
        if lag_events and (not self._marks or self._marks[-1][0] < there):
            self._marks.append((there, now_s))
        if len(self._marks) == MARKS_LIMIT:
            pairs = zip(self._marks[::2], self._marks[1::2], strict=True)
            self._marks = [(later, seen_s) for (_, seen_s), (later, _) in pairs]
        self._events.set(lag_events)
        self._seconds.set(now_s - self._marks[0][1] if lag_events else 0.0)
