"""Which events were there already: sets of identities, kept as ranges of sequence numbers."""

from bisect import bisect_left, bisect_right

from trigpoint.events.envelope import EventIdentity


class SeenSequences:
    """The identities added so far. Memory grows with the gaps in each boot's numbering, not with its events."""

    def __init__(self) -> None:
        self._ranges: dict[tuple[str, str], tuple[list[int], list[int]]] = {}  # starts and stops, half-open

    def add(self, identity: EventIdentity) -> bool:
        """True if the identity was new; it is known from now on."""
        starts, stops = self._ranges.setdefault((identity.source, identity.boot_id), ([], []))
        sequence = identity.sequence
        index = bisect_right(starts, sequence)  # ranges [0, index) start at or before the sequence
        if index and sequence < stops[index - 1]:
            return False
        touches_before = index > 0 and stops[index - 1] == sequence
        touches_after = index < len(starts) and starts[index] == sequence + 1
        if touches_before and touches_after:
            stops[index - 1] = stops.pop(index)
            starts.pop(index)
        elif touches_before:
            stops[index - 1] = sequence + 1
        elif touches_after:
            starts[index] = sequence
        else:
            starts.insert(index, sequence)
            stops.insert(index, sequence + 1)
        return True

    def add_range(self, source: str, boot_id: str, *, start: int, stop: int) -> None:
        """All sequences [start, stop) of a boot are known from now on, whether they were or not."""
        starts, stops = self._ranges.setdefault((source, boot_id), ([], []))
        first, last = bisect_left(stops, start), bisect_right(starts, stop)  # ranges [first, last) touch these
        if first < last:
            start, stop = min(start, starts[first]), max(stop, stops[last - 1])
        starts[first:last] = [start]
        stops[first:last] = [stop]

    def overlaps(self, source: str, boot_id: str, *, start: int, stop: int) -> bool:
        """Whether any of the sequences [start, stop) of a boot is known."""
        starts, stops = self._ranges.get((source, boot_id), ([], []))
        index = bisect_right(stops, start)  # the first range that ends behind the start
        return index < len(starts) and starts[index] < stop

    def covers(self, source: str, boot_id: str, *, start: int, stop: int) -> bool:
        """Whether all of the sequences [start, stop) of a boot are known."""
        starts, stops = self._ranges.get((source, boot_id), ([], []))
        index = bisect_right(starts, start)
        return index > 0 and stop <= stops[index - 1]

    def __contains__(self, identity: EventIdentity) -> bool:
        starts, stops = self._ranges.get((identity.source, identity.boot_id), ([], []))
        index = bisect_right(starts, identity.sequence)
        return index > 0 and identity.sequence < stops[index - 1]

    def boots(self) -> tuple[tuple[str, str], ...]:
        """All (source, boot_id) of which something was seen, in order of appearance."""
        return tuple(self._ranges)

    def ranges(self, source: str, boot_id: str) -> tuple[tuple[int, int], ...]:
        """The half-open ranges of sequences seen of one boot, ascending; what lies between them is missing."""
        starts, stops = self._ranges.get((source, boot_id), ([], []))
        return tuple(zip(starts, stops, strict=True))
