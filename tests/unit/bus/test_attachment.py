"""The attachment's bytes."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trigpoint.bus.attachment import (
    bundled_count,
    decode_attachment,
    decode_bundle,
    encode_attachment,
    encode_bundle,
    uniform_bundle,
)
from trigpoint.errors import InputError
from trigpoint.events.envelope import EventIdentity

INT64 = st.integers(-(2**63), 2**63 - 1)
NAMES = st.text(st.characters(exclude_categories=["Cs"]), max_size=40)


@given(source=NAMES, boot_id=NAMES, sequence=INT64, stamp_ns=INT64, schema_version=st.integers(0, 255))
def test_what_was_attached_is_read_back(
    source: str, boot_id: str, sequence: int, stamp_ns: int, schema_version: int
) -> None:
    identity = EventIdentity(source, boot_id, sequence)
    attachment = encode_attachment(identity, stamp_ns=stamp_ns, schema_version=schema_version)
    assert decode_attachment(attachment) == (identity, stamp_ns, schema_version)


@given(attachment=st.binary(max_size=60))
def test_any_bytes_are_read_or_refused(attachment: bytes) -> None:
    try:
        identity, _, _ = decode_attachment(attachment)
    except InputError:
        return
    assert identity.source is not None


def test_a_truncated_attachment_is_refused() -> None:
    whole = encode_attachment(EventIdentity("vehicle", "", 7), stamp_ns=1, schema_version=1)
    with pytest.raises(InputError, match="ends inside the source of 7 bytes"):
        decode_attachment(whole[:-1])


def test_an_attachment_of_another_layout_is_refused() -> None:
    whole = encode_attachment(EventIdentity("vehicle", "boot", 7), stamp_ns=1, schema_version=1)
    with pytest.raises(InputError, match="layout 1"):
        decode_attachment(b"\x02" + whole[1:])


def test_a_sequence_beyond_64_bits_is_refused() -> None:
    with pytest.raises(InputError, match="sequence"):
        encode_attachment(EventIdentity("vehicle", "boot", 2**63), stamp_ns=1, schema_version=1)


@given(parts=st.lists(st.tuples(st.binary(max_size=30), st.binary(max_size=30)), min_size=1))
def test_what_was_bundled_comes_out_again_and_its_number_is_known(parts: list[tuple[bytes, bytes]]) -> None:
    attachment, payload = encode_bundle(parts)
    assert list(zip(*decode_bundle(payload), strict=True)) == parts
    assert bundled_count(attachment, payload) == len(parts)


def test_a_single_message_counts_as_one() -> None:
    attachment = encode_attachment(EventIdentity("v", "b", 1), stamp_ns=1, schema_version=1)
    assert bundled_count(attachment, b"x" * 100) == 1


@pytest.mark.parametrize(("said", "payload", "count"), [(2**32 - 1, b"x" * 100, 12), (5, b"", 1), (0, b"x" * 100, 1)])
def test_a_bundle_holds_no_more_than_its_payload_has_room_for(said: int, payload: bytes, count: int) -> None:
    assert bundled_count(b"\x02" + said.to_bytes(4, "little"), payload) == count


@pytest.mark.parametrize("cut", [1, 5, 12])
def test_a_truncated_bundle_is_refused(cut: int) -> None:
    _, payload = encode_bundle([(b"abc", b"defg"), (b"h", b"i")])
    with pytest.raises(InputError, match="ends inside"):
        decode_bundle(payload[:-cut])


@given(lengths=st.tuples(st.integers(0, 20), st.integers(0, 20)), count=st.integers(1, 9), die=st.randoms())
def test_a_bundle_of_messages_of_one_length_is_taken_apart_at_once(
    lengths: tuple[int, int], count: int, die: Random
) -> None:
    parts = [(die.randbytes(lengths[0]), die.randbytes(lengths[1])) for _ in range(count)]
    found = uniform_bundle(encode_bundle(parts)[1])
    assert found is not None
    assert list(zip(map(bytes, found[0]), found[1], strict=True)) == parts


@given(parts=st.lists(st.tuples(st.binary(max_size=9), st.binary(max_size=9)), min_size=1))
def test_what_is_taken_apart_at_once_is_what_one_message_after_another_gives(
    parts: list[tuple[bytes, bytes]],
) -> None:
    found = uniform_bundle(encode_bundle(parts)[1])
    assert (found is not None) == (len({tuple(map(len, part)) for part in parts}) == 1)


@given(payload=st.binary(max_size=80))
def test_any_bytes_are_a_bundle_of_one_length_or_none(payload: bytes) -> None:
    found = uniform_bundle(payload)
    assert found is None or len(found[0]) == len(found[1]) > 0
