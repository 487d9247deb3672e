"""A chunk's events out of its records: with its message indexes, and with any other bytes in their place."""

import numpy as np
import pytest

from event_examples.rows import imu_rows
from trigpoint.errors import LogDamaged
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope
from trigpoint.events.runs import envelopes
from trigpoint.logs.channels import packed_rows
from trigpoint.logs.chunks import pack, unpacked
from trigpoint.logs.headers import INDEX_HEAD_BYTES, chunk_runs

ROWS = packed_rows(imu_rows(0, 9))
CHUNK = pack(ROWS, np.ones(9, dtype=np.int64), b"")
CHANNELS = {1: ROWS.channels[0]}


def events(data: bytes, indexes: bytes) -> list[Envelope[Event]]:
    return [event for _, run in chunk_runs(data, indexes, 9, CHANNELS) for event in envelopes(run)]


def records() -> bytes:
    """The records of the chunk, as they are before they are compressed."""
    return unpacked(CHUNK.record, checksum_required=True)


def own_index() -> bytes:
    """The message index of the only channel."""
    entries = CHUNK.index_by_channel[1].tobytes()
    return bytes(INDEX_HEAD_BYTES - 4) + len(entries).to_bytes(4, "little") + entries


def shifted_index() -> bytes:
    """An index that names places where no message begins."""
    entries = (CHUNK.index_by_channel[1] + np.array([0, 3], dtype=np.uint64)).tobytes()
    return bytes(INDEX_HEAD_BYTES - 4) + len(entries).to_bytes(4, "little") + entries


@pytest.mark.parametrize(
    "indexes", [own_index(), shifted_index(), b"", b"\xff" * 200], ids=["own", "shifted", "no", "any"]
)
def test_the_events_are_those_packed_whatever_the_index(indexes: bytes) -> None:
    assert events(records(), indexes) == imu_rows(0, 9)


def test_records_cut_short_are_damage() -> None:
    with pytest.raises(LogDamaged, match="does not fit"):
        events(records()[:-1], own_index())


def test_a_time_beyond_64_bits_is_damage() -> None:
    data = bytearray(records())
    data[9 + 2 + 4 : 9 + 2 + 4 + 8] = b"\xff" * 8
    with pytest.raises(LogDamaged, match="beyond 64 bits"):
        events(bytes(data), own_index())
