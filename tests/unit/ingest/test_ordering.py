"""Messages come out in the order they were sent, whatever order they came in."""

import random
from dataclasses import dataclass, replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from trigpoint.events.envelope import EventIdentity
from trigpoint.events.runs import EncodedRun
from trigpoint_ingest.core.ordering import DESCRIPTION_SCHEMA, HELD_BYTES, HELD_LIMIT, RunOrder, described_first


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


def run(*numbers: int) -> EncodedRun:
    return EncodedRun(
        source="a",
        boot_id="boot",
        schemas=("trigpoint.v1.ImuMeasured",),
        schema_of_row=np.zeros(len(numbers), dtype=np.int64),
        sequences=np.array(numbers, dtype=np.int64),
        stamps_ns=np.array(numbers, dtype=np.int64) * 10,
        payloads=[str(number).encode() for number in numbers],
    )


def numbers(released: EncodedRun | None) -> list[int]:
    """The sequences of a run whose rows still belong together."""
    if released is None:
        return []
    found: list[int] = released.sequences.tolist()
    assert (released.stamps_ns == released.sequences * 10).all()
    assert list(released.payloads) == [str(number).encode() for number in found]
    return found


@given(seed=st.integers(0, 2**32), count=st.integers(0, 50))
def test_any_permutation_comes_out_in_order(seed: int, count: int) -> None:
    order = RunOrder(next_sequence=0, capacity=count)
    shuffled = list(range(count))
    random.Random(seed).shuffle(shuffled)
    released = [order.offer([run(number)]).following for number in shuffled]
    assert [number for part in released for number in numbers(part)] == list(range(count))


@given(st.lists(st.lists(st.integers(0, 30), min_size=1), min_size=1))
def test_whatever_comes_goes_on_once_in_order_or_waits(arrivals: list[list[int]]) -> None:
    order = RunOrder(next_sequence=0, capacity=100)
    released = [order.offer([run(*arrival)]) for arrival in arrivals]
    came = {number for arrival in arrivals for number in arrival}
    first_missing = min(set(range(32)) - came)
    assert [number for one in released for number in numbers(one.following)] == list(range(first_missing))
    assert order.held == len({number for number in came if number > first_missing})
    assert (order.awaited, order.overflowed) == (first_missing, 0)


def test_what_was_sent_before_goes_on_at_once() -> None:
    order = RunOrder(next_sequence=5, capacity=10)
    released = order.offer([run(3)])
    assert (numbers(released.again), released.following) == ([3], None)


def test_of_a_number_that_comes_twice_together_one_goes_on() -> None:
    released = RunOrder(next_sequence=0, capacity=10).offer([run(0, 1), run(1, 2)])
    assert (numbers(released.following), released.doubled) == ([0, 1, 2], 1)


def test_a_later_message_waits_for_the_missing_one() -> None:
    order = RunOrder(next_sequence=0, capacity=10)
    released = order.offer([run(1)])
    assert (released.again, released.following, order.held) == (None, None, 1)


def test_what_finds_no_room_is_dropped_and_counted() -> None:
    order = RunOrder(next_sequence=0, capacity=2)
    order.offer([run(3, 1, 2)])
    assert (order.held, order.overflowed) == (2, 1)
    assert numbers(order.offer([run(0)]).following) == [0, 1, 2]


def test_giving_up_releases_what_waits_in_order_and_goes_on_behind_it() -> None:
    order = RunOrder(next_sequence=0, capacity=10)
    order.offer([run(4), run(2)])
    assert numbers(order.give_up()) == [2, 4]
    assert numbers(order.offer([run(5)]).following) == [5]


def test_giving_up_with_nothing_waiting_changes_nothing() -> None:
    order = RunOrder(next_sequence=3, capacity=10)
    assert (order.give_up(), order.awaited) == (None, 3)


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


def test_large_messages_before_their_description_are_held_up_to_a_size() -> None:
    half = bytes(HELD_BYTES // 2)
    early = [replace(numbered(number), payload=half) for number in range(3)]
    found = [(message.identity.sequence, described) for message, described in described_first([*early, description(3)])]
    assert found == [(2, False), (3, True), (0, True), (1, True)]
