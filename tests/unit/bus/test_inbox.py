"""The queue behind a subscription."""

from trigpoint.bus.inbox import Inbox


def test_a_bundle_fills_the_inbox_by_its_messages() -> None:
    inbox: Inbox[str] = Inbox(capacity=10)
    inbox.offer("bundle", count=10)
    inbox.offer("one more")
    assert (inbox.take(0.0), inbox.take(0.0), inbox.lost) == ("bundle", None, 1)


def test_what_was_taken_makes_room_again() -> None:
    inbox: Inbox[str] = Inbox(capacity=10)
    inbox.offer("bundle", count=10)
    inbox.take(0.0)
    inbox.offer("another", count=10)
    assert (inbox.take(0.0), inbox.lost) == ("another", 0)


def test_a_closed_inbox_takes_nothing_in_and_gives_nothing_out() -> None:
    inbox: Inbox[str] = Inbox()
    inbox.offer("kept")
    inbox.close()
    inbox.offer("late")
    assert (inbox.take(0.0), inbox.lost) == (None, 0)


def test_an_inbox_is_full_of_bytes_as_well_as_of_messages() -> None:
    inbox: Inbox[str] = Inbox(100, capacity_bytes=1000)
    inbox.offer("first", size_bytes=999)
    inbox.offer("second", size_bytes=999)
    inbox.offer("third", size_bytes=1)
    assert (inbox.lost, inbox.held) == (1, 2)


def test_bytes_taken_out_make_room_for_others() -> None:
    inbox: Inbox[str] = Inbox(100, capacity_bytes=1000)
    inbox.offer("first", size_bytes=1000)
    inbox.take(0.0)
    inbox.offer("second", size_bytes=1000)
    assert (inbox.lost, inbox.take(0.0)) == (0, "second")


def test_what_waits_is_taken_until_it_is_enough() -> None:
    inbox: Inbox[str] = Inbox(10)
    for item in "abcd":
        inbox.offer(item, count=2, size_bytes=5)
    assert inbox.take_more(count=3, size_bytes=100) == ["a", "b"]
    assert inbox.take_more(count=100, size_bytes=5) == ["c"]
    assert (inbox.take_more(count=0, size_bytes=5), inbox.held, inbox.held_bytes) == ([], 2, 5)


def test_what_was_taken_together_makes_room_again() -> None:
    inbox: Inbox[str] = Inbox(2, capacity_bytes=10)
    inbox.offer("first", count=1, size_bytes=5)
    inbox.offer("second", count=1, size_bytes=5)
    assert inbox.take_more(count=10, size_bytes=100) == ["first", "second"]
    inbox.offer("third", count=1, size_bytes=10)
    assert (inbox.take(0.0), inbox.lost) == ("third", 0)


def test_nothing_is_taken_together_once_closed() -> None:
    inbox: Inbox[str] = Inbox()
    inbox.offer("kept")
    inbox.close()
    assert inbox.take_more(count=10, size_bytes=10) == []
