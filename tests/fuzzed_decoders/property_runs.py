"""Decoders under property-based fuzzing: valid inputs changed here and there, and bytes of chance."""

import struct
from datetime import timedelta
from functools import reduce

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import seed as seeded
from hypothesis import strategies as st

from fuzzed_decoders.targets import Decoder

HANG = timedelta(seconds=10)  # what an input of a few kilobytes may take
CHANGES_AT_MOST = 4
WORDS = tuple(struct.pack("<Q", size) for size in (0, 1, 255, 1 << 16, 1 << 31, 1 << 32, (1 << 63) - 1, (1 << 64) - 1))
Change = tuple[str, float, float, bytes]


def changed(data: bytes, change: Change) -> bytes:
    """The data with one stretch of it cut out, said twice, cut off, or written over or parted by other bytes."""
    kind, at, share, other = change
    start = int(at * len(data))
    stop = start + int(share * share * (len(data) - start))
    if kind == "cut out":
        return data[:start] + data[stop:]
    if kind == "twice":
        return data[:stop] + data[start:]
    if kind == "cut off":
        return data[:start]
    if kind == "over":
        return data[:start] + other + data[start + len(other) :]
    return data[:start] + other + data[start:]


def inputs(seeds: tuple[bytes, ...]) -> st.SearchStrategy[bytes]:
    """Seeds with a few changes, and bytes of chance."""
    share = st.floats(0.0, 1.0, exclude_max=True)
    other = st.binary(min_size=1, max_size=16) | st.sampled_from(WORDS)
    change = st.tuples(st.sampled_from(("cut out", "twice", "cut off", "over", "between")), share, share, other)
    return st.builds(
        lambda data, changes: reduce(changed, changes, data),
        st.sampled_from(seeds) | st.binary(max_size=200),
        st.lists(change, max_size=CHANGES_AT_MOST),
    )


def fed(decoder: Decoder, seeds: tuple[bytes, ...], *, count: int, seed: int) -> tuple[int, int]:
    """How many inputs a decoder got, about `count`, and how many of them it took. Raises what it should not have."""
    tally = [0, 0]

    @seeded(seed)
    @settings(
        max_examples=count,
        deadline=HANG,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(data=inputs(seeds))
    def one(data: bytes) -> None:
        tally[0] += 1
        tally[1] += decoder.takes(data)

    one()
    return tally[0], tally[1]
