"""What was handed to the bus and is not acknowledged: a bounded window over one vehicle's messages, oldest first."""

from collections import Counter, deque

from trigpoint.events.envelope import EventIdentity
from trigpoint_vehicle.core.outgoing import Outgoing


class UnderWay:
    """The window: messages to be sent, then those sent; an acknowledgement takes them out at the old end.

    Only what was sent is ever taken out, whatever an acknowledgement claims.
    """

    def __init__(self, *, limit: int, limit_bytes: int) -> None:
        self._limit = limit
        self._limit_bytes = limit_bytes
        self._unsent: deque[Outgoing] = deque()
        self._sent: deque[Outgoing] = deque()
        self._to_repeat = 0  # the first so many of the unsent were sent before
        self._bytes = 0
        self._sent_of_boot: Counter[str] = Counter()
        self._highest_sent: dict[str, int] = {}
        self._acknowledged: dict[str, int] = {}
        self.resent = 0

    def __len__(self) -> int:
        return len(self._unsent) + len(self._sent)

    @property
    def awaiting(self) -> int:
        """How many were sent and wait for their acknowledgement."""
        return len(self._sent) + self._to_repeat

    @property
    def unsent(self) -> int:
        """How many wait to be sent, for the first time or again."""
        return len(self._unsent)

    @property
    def oldest(self) -> Outgoing:
        """The one that waits longest. Raises IndexError if there is none."""
        return self._sent[0] if self._sent else self._unsent[0]

    @property
    def room(self) -> int:
        """How many more fit in: by number, and none while the bytes are at their limit."""
        return max(self._limit - len(self), 0) if self._bytes < self._limit_bytes else 0

    @property
    def room_bytes(self) -> int:
        """How many more bytes fit in."""
        return max(self._limit_bytes - self._bytes, 0)

    def add(self, message: Outgoing) -> None:
        """The message queued behind the others."""
        self._unsent.append(message)
        self._bytes += len(message.payload)

    def to_send(self, *, count: int, size_bytes: int) -> list[Outgoing]:
        """The next messages, oldest first, at most `count` and no more bytes than that (but at least one); now sent."""
        chosen: list[Outgoing] = []
        while self._unsent and len(chosen) < count and (size_bytes > 0 or not chosen):
            message = self._unsent[0]
            size_bytes -= len(message.payload)
            if chosen and size_bytes < 0:
                break
            chosen.append(self._unsent.popleft())
            self._mark_sent(message)
        return chosen

    def _mark_sent(self, message: Outgoing) -> None:
        boot_id, sequence = message.channel.boot_id, message.sequence
        self._sent.append(message)
        if self._to_repeat:
            self._to_repeat -= 1
            self.resent += 1
        else:
            self._sent_of_boot[boot_id] += 1
            self._highest_sent[boot_id] = max(sequence, self._highest_sent.get(boot_id, sequence))

    def send_again(self) -> int:
        """How many messages are to be sent once more: all that were sent and not acknowledged."""
        self._to_repeat += len(self._sent)
        self._sent.extend(self._unsent)
        self._unsent, self._sent = self._sent, self._unsent
        self._sent.clear()
        return self._to_repeat

    def accept(self, acknowledged: EventIdentity) -> int:
        """How many messages are done with after this acknowledgement."""
        boot_id = acknowledged.boot_id
        if boot_id not in self._highest_sent:
            return 0
        reached = min(acknowledged.sequence, self._highest_sent[boot_id])
        if reached > self._acknowledged.get(boot_id, -1):
            self._acknowledged[boot_id] = reached
        return self._done(self._sent) + (self._done_again() if not self._sent else 0)

    def _done(self, messages: deque[Outgoing]) -> int:
        done = 0
        while messages and self._covered(messages[0]):
            self._forget(messages.popleft())
            done += 1
        return done

    def _done_again(self) -> int:
        done = 0
        while self._to_repeat and self._covered(self._unsent[0]):
            self._forget(self._unsent.popleft())
            self._to_repeat -= 1
            done += 1
        return done

    def _covered(self, message: Outgoing) -> bool:
        return message.sequence <= self._acknowledged.get(message.channel.boot_id, -1)

    def _forget(self, message: Outgoing) -> None:
        boot_id = message.channel.boot_id
        self._bytes -= len(message.payload)
        self._sent_of_boot[boot_id] -= 1
        if not self._sent_of_boot[boot_id]:
            del self._sent_of_boot[boot_id], self._highest_sent[boot_id]
            self._acknowledged.pop(boot_id, None)
