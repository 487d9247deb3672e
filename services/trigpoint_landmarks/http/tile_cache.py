"""Tiles kept in memory, the least recently asked for dropped first."""

from collections import OrderedDict
from collections.abc import Hashable

ENTRY_BYTES = 200  # what an entry costs beside its content


class TileCache:
    """Contents by key, at most so many bytes of them together."""

    def __init__(self, *, limit_bytes: int) -> None:
        self._limit_bytes = limit_bytes
        self._held: OrderedDict[Hashable, bytes] = OrderedDict()
        self.size_bytes = 0

    def __len__(self) -> int:
        return len(self._held)

    def get(self, key: Hashable) -> bytes | None:
        """The content of a key, None for one that is not held."""
        content = self._held.get(key)
        if content is not None:
            self._held.move_to_end(key)
        return content

    def put(self, key: Hashable, content: bytes) -> None:
        """The content held from now on, unless it is larger than all that may be."""
        self._drop(key)
        cost = len(content) + ENTRY_BYTES
        if cost > self._limit_bytes:
            return
        self._held[key] = content
        self.size_bytes += cost
        while self.size_bytes > self._limit_bytes:
            self._drop(next(iter(self._held)))

    def _drop(self, key: Hashable) -> None:
        content = self._held.pop(key, None)
        if content is not None:
            self.size_bytes -= len(content) + ENTRY_BYTES
