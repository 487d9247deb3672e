"""The bounded queue behind every subscription: it never blocks the transport, and counts what it had to drop."""

import contextlib
import queue
import threading
from typing import Generic, TypeVar

ItemT = TypeVar("ItemT")

INBOX_CAPACITY = 1_048_576  # messages: the windows of 128 vehicles' publishers
INBOX_BYTES = 256 * 1024 * 1024  # what they take in memory: the windows of 16 vehicles that send point clouds


class Inbox(Generic[ItemT]):
    """Items in order of arrival, until they are `capacity` messages or `capacity_bytes`; the newest are dropped, and
    counted, when full.
    """

    def __init__(self, capacity: int = INBOX_CAPACITY, *, capacity_bytes: int = INBOX_BYTES) -> None:
        self._capacity, self._capacity_bytes = capacity, capacity_bytes
        self._items: queue.SimpleQueue[tuple[ItemT, int, int] | None] = queue.SimpleQueue()
        self._held = 0  # messages
        self._held_bytes = 0
        self._lost = 0
        self._lock = threading.Lock()
        self._closed = threading.Event()

    @property
    def lost(self) -> int:
        """How many messages were dropped because the inbox was full."""
        return self._lost

    @property
    def held(self) -> int:
        """How many messages wait."""
        return self._held

    @property
    def held_bytes(self) -> int:
        """How many bytes they are."""
        return self._held_bytes

    def offer(self, item: ItemT, *, count: int = 1, size_bytes: int = 0) -> None:
        """The item of `count` messages queued, or lost if the inbox is full; without effect once closed."""
        if self._closed.is_set():
            return
        with self._lock:
            if self._held < self._capacity and self._held_bytes < self._capacity_bytes:
                self._held += count
                self._held_bytes += size_bytes
                self._items.put((item, count, size_bytes))
            else:
                self._lost += count

    def take(self, timeout_s: float) -> ItemT | None:
        """The oldest item, or None if none came within `timeout_s` or the inbox is closed."""
        if self._closed.is_set():
            return None
        try:
            taken = self._items.get(timeout=timeout_s) if timeout_s > 0.0 else self._items.get_nowait()
        except queue.Empty:
            return None
        if taken is None or self._closed.is_set():
            return None
        item, count, size_bytes = taken
        with self._lock:
            self._held -= count
            self._held_bytes -= size_bytes
        return item

    def take_more(self, *, count: int, size_bytes: int) -> list[ItemT]:
        """The oldest items, in order: those that wait now, until they are `count` messages or `size_bytes`."""
        taken: list[ItemT] = []
        taken_count = taken_bytes = 0
        with contextlib.suppress(queue.Empty):
            while taken_count < count and taken_bytes < size_bytes and not self._closed.is_set():
                held = self._items.get_nowait()
                if held is None:
                    break
                taken.append(held[0])
                taken_count += held[1]
                taken_bytes += held[2]
        with self._lock:
            self._held -= taken_count
            self._held_bytes -= taken_bytes
        return taken

    def close(self) -> list[ItemT]:
        """What was still waiting; nothing more comes in or out, and a `take` that waits returns None."""
        self._closed.set()
        dropped: list[ItemT] = []
        with contextlib.suppress(queue.Empty):
            while True:
                held = self._items.get_nowait()
                if held is not None:
                    dropped.append(held[0])
        self._items.put(None)
        return dropped
