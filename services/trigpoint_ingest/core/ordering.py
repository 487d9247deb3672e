"""Messages put back into the order they were sent in: live ones by number, a file's behind its description."""

from collections.abc import Iterable, Iterator
from typing import TypeVar

from trigpoint.events.codec import schema_name
from trigpoint.events.observed import VehicleDescribed
from trigpoint_ingest.core.messages import RawMessage
from trigpoint_ingest.core.validation import Drive, drive_of

DESCRIPTION_SCHEMA = schema_name(VehicleDescribed)
HELD_LIMIT = 10_000  # messages of a file that may stand before their drive's description

MessageT = TypeVar("MessageT", bound=RawMessage)


def described_first(messages: Iterable[MessageT]) -> Iterator[tuple[MessageT, bool]]:
    """The messages in their order, but each drive's behind its description; with each whether its drive has one.

    At most HELD_LIMIT messages wait for a description; what comes on top of them counts as without one.
    """
    described: set[Drive] = set()
    held: dict[Drive, list[MessageT]] = {}
    held_count = 0
    for message in messages:
        drive = drive_of(message.identity)
        if drive in described:
            yield message, True
        elif message.schema_name == DESCRIPTION_SCHEMA:
            described.add(drive)
            waiting = held.pop(drive, [])
            held_count -= len(waiting)
            for ordered in (message, *waiting):
                yield ordered, True
        elif held_count < HELD_LIMIT:
            held.setdefault(drive, []).append(message)
            held_count += 1
        else:
            yield message, False
    for waiting in held.values():
        for message in waiting:
            yield message, False


class SequenceOrder:
    """Holds what came early, at most `capacity` messages, until what lies before it has come."""

    def __init__(self, *, next_sequence: int, capacity: int) -> None:
        self._next = next_sequence
        self._capacity = capacity
        self._held: dict[int, RawMessage] = {}
        self.overflowed = 0

    @property
    def awaited(self) -> int:
        """The number of the message that may go on next."""
        return self._next

    @property
    def held(self) -> int:
        """How many messages wait for an earlier one."""
        return len(self._held)

    def offer(self, message: RawMessage) -> list[RawMessage]:
        """The messages that may go on now, in order: none while an earlier one is missing.

        What was sent before goes on at once (it is a duplicate, or late after `give_up`); what finds no room
        is dropped and counted in `overflowed`: unacknowledged, it will be sent again.
        """
        sequence = message.identity.sequence
        if sequence < self._next:
            return [message]
        if sequence > self._next:
            if len(self._held) < self._capacity or sequence in self._held:
                self._held[sequence] = message
            else:
                self.overflowed += 1
            return []
        released = [message]
        self._next = sequence + 1
        while self._next in self._held:
            released.append(self._held.pop(self._next))
            self._next += 1
        return released

    def give_up(self) -> list[RawMessage]:
        """Everything held, in order: what is missing is not waited for any longer."""
        released = [self._held[sequence] for sequence in sorted(self._held)]
        self._held.clear()
        if released:
            self._next = released[-1].identity.sequence + 1
        return released
