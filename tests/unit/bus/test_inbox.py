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
