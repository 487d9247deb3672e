"""Messages put back into the order they were sent in: live ones by number, a file's behind its description."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from trigpoint.events.codec import schema_name
from trigpoint.events.envelope import EncodedMessage
from trigpoint.events.observed import VehicleDescribed
from trigpoint.events.runs import EncodedRun, Integers, joined
from trigpoint_ingest.core.validation import Drive, drive_of

DESCRIPTION_SCHEMA = schema_name(VehicleDescribed)
HELD_LIMIT = 10_000  # messages of a file that may stand before their drive's description
HELD_BYTES = 64 * 1024 * 1024  # of their payloads

MessageT = TypeVar("MessageT", bound=EncodedMessage)


def described_first(messages: Iterable[MessageT]) -> Iterator[tuple[MessageT, bool]]:
    """The messages in their order, but each drive's behind its description; with each whether its drive has one.

    At most HELD_LIMIT messages and HELD_BYTES wait for a description; what comes on top of them counts as without one.
    """
    described: set[Drive] = set()
    held: dict[Drive, list[MessageT]] = {}
    held_count = held_bytes = 0
    for message in messages:
        drive = drive_of(message.identity)
        if drive in described:
            yield message, True
        elif message.schema_name == DESCRIPTION_SCHEMA:
            described.add(drive)
            waiting = held.pop(drive, [])
            held_count -= len(waiting)
            held_bytes -= sum(len(one.payload) for one in waiting)
            for ordered in (message, *waiting):
                yield ordered, True
        elif held_count < HELD_LIMIT and held_bytes + len(message.payload) <= HELD_BYTES:
            held.setdefault(drive, []).append(message)
            held_count += 1
            held_bytes += len(message.payload)
        else:
            yield message, False
    for waiting in held.values():
        for message in waiting:
            yield message, False


@dataclass(frozen=True, slots=True)
class Released:
    """What may go on now: messages sent before (duplicates, or late after `give_up`), and those next in order; both
    ascending, each number once. `doubled` messages were there twice among them and go nowhere.
    """

    again: EncodedRun | None
    following: EncodedRun | None
    doubled: int


class RunOrder:
    """Puts one drive's messages in order: what came early, at most `capacity` messages, is held until what lies before
    it has come."""

    def __init__(self, *, next_sequence: int, capacity: int) -> None:
        self._next = next_sequence
        self._capacity = capacity
        self._held: EncodedRun | None = None
        self.overflowed = 0

    @property
    def awaited(self) -> int:
        """The number of the message that may go on next."""
        return self._next

    @property
    def held(self) -> int:
        """How many messages wait for an earlier one."""
        return 0 if self._held is None else len(self._held)

    def offer(self, runs: Sequence[EncodedRun]) -> Released:
        """What may go on now, of the drive's runs that came since the last time and of those held.

        What finds no room to wait is dropped, the latest first, and counted in `overflowed`: unacknowledged, it will
        be sent again.
        """
        everything = joined(runs if self._held is None else (self._held, *runs))
        ordered = _ascending(everything)
        sequences, doubled = ordered.sequences, len(everything) - len(ordered)
        if sequences[0] == self._next and sequences[-1] == self._next + len(sequences) - 1:
            self._next, self._held = self._next + len(sequences), None
            return Released(None, ordered, doubled)
        old = int(np.searchsorted(sequences, self._next))
        stop = old + _run_length(sequences[old:], self._next)
        if stop > old:
            self._next = int(sequences[stop - 1]) + 1
        kept = min(len(ordered), stop + self._capacity)
        self.overflowed += len(ordered) - kept
        self._held = _part(ordered, stop, kept)
        return Released(_part(ordered, 0, old), _part(ordered, old, stop), doubled)

    def give_up(self) -> EncodedRun | None:
        """Everything held, in order: what is missing is not waited for any longer."""
        released, self._held = self._held, None
        if released is not None:
            self._next = int(released.sequences[-1]) + 1
        return released


def _part(run: EncodedRun, start: int, stop: int) -> EncodedRun | None:
    if start == stop:
        return None
    return run if stop - start == len(run) else run.part(start, stop)


def _ascending(run: EncodedRun) -> EncodedRun:
    """The messages by their numbers; of those of one number the first that came."""
    steps = np.diff(run.sequences)
    if bool((steps > 0).all()):
        return run
    order = np.argsort(run.sequences, kind="stable")
    new = np.diff(run.sequences[order], prepend=run.sequences[order[0]] - 1) != 0
    return run.picked(order[new])


def _run_length(sequences: Integers, first: int) -> int:
    """How many of ascending sequences (n,) follow one another from `first` on."""
    gaps = np.flatnonzero(sequences != np.arange(first, first + len(sequences)))
    return int(gaps[0]) if len(gaps) else len(sequences)
