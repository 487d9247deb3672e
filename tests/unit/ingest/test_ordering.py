"""Messages come out in the order they were sent, whatever order they came in."""

import random
from dataclasses import dataclass

from hypothesis import given
from hypothesis import strategies as st

from trigpoint.events.envelope import EventIdentity
from trigpoint_ingest.core.ordering import DESCRIPTION_SCHEMA, HELD_LIMIT, SequenceOrder, described_first


@dataclass(frozen=True)
class Message:
    identity: EventIdentity
    schema_name: str = "trigpoint.v1.ImuMeasured"
    payload: bytes = b""
    stamp_ns: int = 0


def numbered(sequence: int, *, vehicle: str = "a") -> Message:
    return Message(EventIdentity(vehicle, "boot", sequence))


def description(sequence: int, *, vehicle: str = "a") -> Message:
    return Message(EventIdentity(vehicle, "boot", sequence), DESCRIPTION_SCHEMA)


def sequences(messages: list[object]) -> list[int]:
    return [message.identity.sequence for message in messages]  # type: ignore[attr-defined]


@given(seed=st.integers(0, 2**32), count=st.integers(0, 50))
def test_any_permutation_comes_out_in_order(seed: int, count: int) -> None:
    order = SequenceOrder(next_sequence=0, capacity=count)
    shuffled = [numbered(sequence) for sequence in range(count)]
    random.Random(seed).shuffle(shuffled)
    released = [message for arrived in shuffled for message in order.offer(arrived)]
    assert sequences(list(released)) == list(range(count))


def test_what_was_sent_before_goes_on_at_once() -> None:
    order = SequenceOrder(next_sequence=5, capacity=10)
    assert sequences(list(order.offer(numbered(3)))) == [3]


def test_a_later_message_waits_for_the_missing_one() -> None:
    order = SequenceOrder(next_sequence=0, capacity=10)
    assert order.offer(numbered(1)) == []
    assert order.held == 1


def test_what_finds_no_room_is_dropped_and_counted() -> None:
    order = SequenceOrder(next_sequence=0, capacity=2)
    for sequence in (1, 2, 3):
        order.offer(numbered(sequence))
    assert (order.held, order.overflowed) == (2, 1)


def test_giving_up_releases_what_waits_in_order_and_goes_on_behind_it() -> None:
    order = SequenceOrder(next_sequence=0, capacity=10)
    for sequence in (4, 2):
        order.offer(numbered(sequence))
    assert sequences(list(order.give_up())) == [2, 4]
    assert sequences(list(order.offer(numbered(5)))) == [5]


def test_a_files_messages_follow_their_drives_description() -> None:
    mixed = [numbered(1), numbered(7, vehicle="b"), description(0), numbered(2), description(6, vehicle="b")]
    ordered = [(message.identity.source, message.identity.sequence) for message, _ in described_first(mixed)]
    assert ordered == [("a", 0), ("a", 1), ("a", 2), ("b", 6), ("b", 7)]


def test_messages_of_a_drive_without_description_are_marked() -> None:
    marked = [
        (message.identity.source, known)
        for message, known in described_first([numbered(3), description(0, vehicle="b")])
    ]
    assert marked == [("b", True), ("a", False)]


def test_a_file_without_description_is_not_held_in_memory_whole() -> None:
    endless = (numbered(sequence) for sequence in range(HELD_LIMIT + 1))
    message, known = next(described_first(endless))
    assert (message.identity.sequence, known) == (HELD_LIMIT, False)
