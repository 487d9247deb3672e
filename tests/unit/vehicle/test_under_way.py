"""What is under way leaves by acknowledgement only, in order, boot by boot."""

from collections.abc import Iterable

from hypothesis import given
from hypothesis import strategies as st

from trigpoint.events.envelope import EventIdentity
from trigpoint_vehicle.core.outgoing import Outgoing, SendChannel
from trigpoint_vehicle.core.under_way import UnderWay

CHANNELS = {boot: SendChannel("veh-a", boot, "schema", "key") for boot in ("old", "new")}


def under_way(messages: Iterable[tuple[str, int]], *, limit: int = 100, limit_bytes: int = 1000) -> UnderWay:
    window = UnderWay(limit=limit, limit_bytes=limit_bytes)
    for boot, sequence in messages:
        window.add(Outgoing(CHANNELS[boot], sequence, 0, b"x" * 10))
    return window


def sent(window: UnderWay, *, count: int = 1000, size_bytes: int = 10_000) -> list[int]:
    return [message.sequence for message in window.to_send(count=count, size_bytes=size_bytes)]


def acknowledged(boot: str, sequence: int) -> EventIdentity:
    return EventIdentity("veh-a", boot, sequence)


def test_an_acknowledgement_covers_everything_of_its_boot_up_to_its_number() -> None:
    window = under_way([("old", 0), ("old", 1), ("old", 2)])
    assert sent(window) == [0, 1, 2]
    assert window.accept(acknowledged("old", 1)) == 2
    assert window.oldest.sequence == 2


def test_what_was_not_sent_is_not_acknowledged_whatever_is_claimed() -> None:
    window = under_way([("old", 0), ("old", 1)])
    assert sent(window, count=1) == [0]
    assert window.accept(acknowledged("old", 10**9)) == 1
    assert sent(window) == [1]
    assert window.accept(acknowledged("other", 10**9)) == 0
    assert len(window) == 1


def test_a_later_boot_waits_for_the_older_one_and_its_acknowledgement_is_remembered() -> None:
    window = under_way([("old", 8), ("new", 0)])
    sent(window)
    assert window.accept(acknowledged("new", 0)) == 0
    assert window.accept(acknowledged("old", 8)) == 2


def test_sent_again_is_everything_unacknowledged_in_order_before_anything_new() -> None:
    window = under_way([("old", number) for number in range(4)])
    sent(window, count=3)
    window.accept(acknowledged("old", 0))
    assert window.send_again() == 2
    assert sent(window) == [1, 2, 3]
    assert window.resent == 2


def test_an_acknowledgement_takes_out_what_waits_to_be_sent_again() -> None:
    window = under_way([("old", number) for number in range(4)])
    sent(window)
    window.send_again()
    assert window.accept(acknowledged("old", 2)) == 3
    assert sent(window) == [3]


def test_there_is_room_by_number_and_by_bytes() -> None:
    assert under_way([("old", 0), ("old", 1)], limit=3).room == 1
    full = under_way([("old", 0), ("old", 1)], limit_bytes=20)
    assert (full.room, full.room_bytes) == (0, 0)


def test_together_goes_what_fits_but_at_least_one() -> None:
    window = under_way([("old", number) for number in range(5)])
    assert sent(window, size_bytes=25) == [0, 1]
    assert sent(window, size_bytes=1) == [2]
    assert sent(window, count=1) == [3]


@given(
    steps=st.lists(
        st.one_of(
            st.integers(1, 7).map(lambda count: ("send", count)),
            st.integers(-1, 40).map(lambda number: ("acknowledge", number)),
            st.just(("again", 0)),
        ),
        max_size=30,
    )
)
def test_nothing_leaves_twice_or_unsent_in_any_course_of_things(steps: list[tuple[str, int]]) -> None:
    window = under_way([("old", number) for number in range(30)])
    heard: set[int] = set()
    done = 0
    for what, number in steps:
        if what == "send":
            heard |= set(sent(window, count=number))
        elif what == "again":
            window.send_again()
        else:
            done += window.accept(acknowledged("old", number))
    assert done + len(window) == 30
    assert set(range(done)) <= heard
