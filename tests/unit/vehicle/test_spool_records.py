"""A segment's records come back as they went in, and nothing damaged passes for one."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trigpoint.errors import InputError, LogDamaged
from trigpoint_vehicle.core.spool_records import (
    HEAD_BYTES,
    MESSAGE,
    Record,
    SpoolChannel,
    channel_of,
    channel_record,
    encode_record,
    next_whole_record,
    segment_of,
    segment_record,
    whole_records,
)

INT64 = st.integers(-(2**63), 2**63 - 1)
FIELDS = st.tuples(st.integers(0, 2**16 - 1), INT64, INT64, INT64, st.binary(max_size=60))
RECORD = encode_record(MESSAGE, 3, 17, 18, 19, b"payload")


@given(rows=st.lists(FIELDS, max_size=6))
def test_records_come_back_as_they_went_in(rows: list[tuple[int, int, int, int, bytes]]) -> None:
    data = b"".join(encode_record(MESSAGE, *row) for row in rows)
    records, end = whole_records(data, 0, count=100)
    assert records == [Record(MESSAGE, *row) for row in rows]
    assert end == len(data)


@given(bit=st.integers(0, 8 * len(RECORD) - 1))
def test_a_record_with_one_bit_flipped_is_none(bit: int) -> None:
    flipped = bytearray(RECORD)
    flipped[bit // 8] ^= 1 << bit % 8
    assert whole_records(bytes(flipped), 0, count=1) == ([], 0)


@given(length=st.integers(0, len(RECORD) - 1))
def test_a_record_cut_short_is_none(length: int) -> None:
    assert whole_records(RECORD[:length], 0, count=1) == ([], 0)


@given(junk=st.binary(min_size=1, max_size=200))
def test_the_first_whole_record_behind_damage_is_found(junk: bytes) -> None:
    data = b"\0" + junk + RECORD
    assert next_whole_record(data, 0) == 1 + len(junk)


def test_without_a_whole_record_behind_damage_the_data_end_there() -> None:
    assert next_whole_record(b"\xa5" * 100, 0) == 100


def test_a_sequence_beyond_64_bits_is_refused_with_the_limit() -> None:
    with pytest.raises(InputError, match="9223372036854775808.*signed 64 bits"):
        encode_record(MESSAGE, 0, 2**63, 0, 0)


@pytest.mark.parametrize("numbered", [True, False])
def test_a_channel_comes_back(numbered: bool) -> None:
    written = SpoolChannel("veh-a", "boot", "trigpoint.v1.ImuMeasured", numbered)
    found = channel_of(whole_records(channel_record(5, written), 0, count=1)[0][0])
    assert (found.source, found.boot_id, found.schema_name, found.numbered) == (
        "veh-a",
        "boot",
        "trigpoint.v1.ImuMeasured",
        numbered,
    )


def test_a_name_with_a_nul_is_refused() -> None:
    with pytest.raises(InputError, match="NUL"):
        channel_record(0, SpoolChannel("veh\0a", "boot", "schema", True))


def test_a_segment_names_its_vehicle_and_boot() -> None:
    (first,), end = whole_records(segment_record("veh-a", "boot", next_sequence=7, spooled_ns=9), 0, count=1)
    assert segment_of(first) == ("veh-a", "boot")
    assert first.sequence == 7
    assert end > HEAD_BYTES


def test_a_message_is_no_beginning_of_a_segment() -> None:
    (record,), _ = whole_records(RECORD, 0, count=1)
    with pytest.raises(LogDamaged, match="no segment of a spool"):
        segment_of(record)
