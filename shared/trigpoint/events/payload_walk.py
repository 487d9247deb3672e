"""Many Protobuf payloads read side by side, field after field in the order a writer puts them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

VARINT_LONGEST = 10  # bytes
REPEATED_MOST = 64  # elements of a field that are walked over; who has more is decoded alone
BEHIND = bytes(64)  # the last payload: what is read past its end is thrown away, but has to be there


class PayloadWalk:
    """Where each of n payloads has been read to. `differs` (n,) marks those that are not laid out as was asked for:
    what is said of them means nothing.
    """

    def __init__(self, payloads: Sequence[bytes]) -> None:
        sizes = np.fromiter(map(len, payloads), dtype=np.int64, count=len(payloads))
        self.differs: Mask = np.zeros(len(sizes), dtype=np.bool_)
        self._joined = b"".join((*payloads, BEHIND))
        self._bytes = np.frombuffer(self._joined, dtype=np.uint8)
        self._ends: Ints = np.cumsum(sizes)
        self._at: Ints = self._ends - sizes

    def whole_numbers(self, tag: int) -> Ints:
        """The varint (n,) of a field; 0 where it is absent."""
        there = self._there(tag)
        values, after = self._varints(self._at + 1, there)
        self._move(there, after)
        return values

    def fixed_numbers(self, tag: int) -> Ints:
        """The 64-bit whole number (n,) of a field; 0 where it is absent."""
        there = self._there(tag)
        values = np.where(there, self._from_each_byte("<i8")[self._at + 1], 0)
        self._move(there, self._at + 9)
        return values

    def packed_doubles(self, tag: int, count: int) -> Floats:
        """The numbers (n, count) of a repeated field; one that does not have just so many differs."""
        there = self._there(tag) & (self._bytes[self._at + 1] == 8 * count)
        places = self._at[:, np.newaxis] + (2 + 8 * np.arange(count))
        self.differs |= ~there
        self._move(there, self._at + 2 + 8 * count)
        return np.asarray(self._from_each_byte("<f8")[places])

    def parts(self, tags: Sequence[int]) -> list[bytes]:
        """The bytes of some texts that stand one behind the other, each at most once, tags and lengths with them."""
        starts = self._at
        for tag in tags:
            self._pass(self._there(tag))
        return self._cut(starts, self._at)

    def repeated(self, tag: int) -> list[bytes]:
        """The bytes of a repeated text, tags and lengths with them."""
        starts = self._at
        for _ in range(REPEATED_MOST):
            there = self._there(tag)
            if not there.any():
                break
            self._pass(there)
        return self._cut(starts, self._at)

    def rest(self) -> list[bytes]:
        """Everything that has not been read."""
        return self._cut(self._at, self._ends)

    def _there(self, tag: int) -> Mask:
        return np.asarray((self._bytes[self._at] == tag) & (self._at < self._ends))

    def _pass(self, there: Mask) -> None:
        lengths, after = self._varints(self._at + 1, there)
        self._move(there, after + np.where(lengths < 0, len(self._joined), np.minimum(lengths, len(self._joined))))

    def _move(self, there: Mask, to: Ints) -> None:
        fits = to <= self._ends
        self.differs |= there & ~fits
        self._at = np.where(there & fits, to, self._at)

    def _varints(self, places: Ints, there: Mask) -> tuple[Ints, Ints]:
        """The numbers at these places, and where they end; 0 and the place itself where none is."""
        values, at, going = np.zeros(len(places), dtype=np.uint64), places.copy(), there.copy()
        for index in range(VARINT_LONGEST):
            read = self._bytes[at]
            values |= np.where(going, read & 0x7F, 0).astype(np.uint64) << np.uint64(7 * index)
            at += going
            going &= read >= 0x80
            if not going.any():
                break
        self.differs |= going
        return values.view(np.int64), at

    def _from_each_byte(self, kind: str) -> NDArray[np.generic]:
        """The number of 8 bytes that begins at each byte."""
        return np.ndarray((len(self._bytes) - 7,), kind, self._joined, strides=(1,))

    def _cut(self, starts: Ints, stops: Ints) -> list[bytes]:
        joined = self._joined
        return [joined[start:stop] for start, stop in zip(starts.tolist(), stops.tolist(), strict=True)]
