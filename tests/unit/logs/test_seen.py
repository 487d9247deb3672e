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
