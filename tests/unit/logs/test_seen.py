from hypothesis import given, settings
from hypothesis import strategies as st

from trigpoint.events.envelope import EventIdentity
from trigpoint.events.seen import SeenSequences


def _van(sequence: int) -> EventIdentity:
    return EventIdentity("van", "boot-1", sequence)


def test_an_identity_is_new_once() -> None:
    seen = SeenSequences()
    assert [seen.add(_van(7)), seen.add(_van(7))] == [True, False]


def test_boots_and_sources_number_apart() -> None:
    seen = SeenSequences()
    seen.add(_van(0))
    assert seen.add(EventIdentity("van", "boot-2", 0))
    assert seen.add(EventIdentity("car", "boot-1", 0))


def test_a_filled_gap_leaves_one_range() -> None:
    seen = SeenSequences()
    for sequence in (0, 2, 1):
        seen.add(_van(sequence))
    assert seen.ranges("van", "boot-1") == ((0, 3),)


@given(st.lists(st.integers(0, 40)))
@settings(max_examples=200, deadline=None, derandomize=True)
def test_it_answers_as_a_set_does(sequences: list[int]) -> None:
    seen = SeenSequences()
    new = [seen.add(_van(sequence)) for sequence in sequences]
    assert new == [sequence not in sequences[:index] for index, sequence in enumerate(sequences)]
    assert {sequence for sequence in range(42) if _van(sequence) in seen} == set(sequences)


@given(st.lists(st.integers(0, 40)))
@settings(max_examples=100, deadline=None, derandomize=True)
def test_ranges_ascend_and_never_touch(sequences: list[int]) -> None:
    seen = SeenSequences()
    for sequence in sequences:
        seen.add(_van(sequence))
    bounds = [bound for both in seen.ranges("van", "boot-1") for bound in both]
    assert bounds == sorted(set(bounds))


@given(st.lists(st.tuples(st.integers(0, 40), st.integers(1, 10))), st.integers(0, 50), st.integers(1, 10))
@settings(max_examples=200, deadline=None, derandomize=True)
def test_ranges_added_are_as_their_numbers_added(added: list[tuple[int, int]], start: int, count: int) -> None:
    seen, one_by_one = SeenSequences(), SeenSequences()
    for first, length in added:
        seen.add_range("van", "boot-1", start=first, stop=first + length)
        for sequence in range(first, first + length):
            one_by_one.add(_van(sequence))
    asked = [_van(sequence) in one_by_one for sequence in range(start, start + count)]
    assert seen.ranges("van", "boot-1") == one_by_one.ranges("van", "boot-1")
    assert seen.covers("van", "boot-1", start=start, stop=start + count) == all(asked)
    assert seen.overlaps("van", "boot-1", start=start, stop=start + count) == any(asked)
