"""Messages of a drive put back into the order they were sent in, while what is missing is sent again."""

from trigpoint_ingest.core.messages import RawMessage


class SequenceOrder:
    """Holds what came early, at most `capacity` messages, until what lies before it has come."""

    def __init__(self, *, next_sequence: int, capacity: int) -> None:
        self._next = next_sequence
        self._capacity = capacity
        self._held: dict[int, RawMessage] = {}
        self.overflowed = 0

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
