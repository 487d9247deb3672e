"""What every bus does for those who only want to be woken: the same claims hold in memory and on Zenoh."""

import threading
import time

import pytest

from bus_sessions.pairs import NEVER_S, SMALL_INBOX, SOON_S, message, until_heard
from trigpoint.bus.ports import Bus
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings
from trigpoint.errors import InputError, ServiceError

ENDED = 50  # subscriptions begun and ended by a daemon thread


def test_a_message_is_news_once(pair: tuple[Bus, Bus]) -> None:
    publisher, listener = pair
    news = listener.news("t/*")
    until_heard(publisher, "t/a")
    assert not news.wait(NEVER_S)
    publisher.publish(message("t/a"))
    assert news.wait(SOON_S)
    assert not news.wait(NEVER_S)


def test_news_of_many_messages_nobody_listened_to_is_one(pair: tuple[Bus, Bus]) -> None:
    publisher, listener = pair
    news, last = listener.news("t/*"), listener.subscribe("t/last")
    until_heard(publisher, "t/a")
    until_heard(publisher, "t/last")
    publisher.publish_all([message("t/a", sequence) for sequence in range(100 * SMALL_INBOX)])
    publisher.publish(message("t/last"))
    assert last.receive(SOON_S) is not None
    assert news.wait(SOON_S)
    while news.wait(NEVER_S):  # one more at most, of what was still under way
        assert not news.wait(NEVER_S)


def test_what_does_not_match_is_no_news(pair: tuple[Bus, Bus]) -> None:
    publisher, listener = pair
    news, other = listener.news("t/a"), listener.subscribe("t/b")
    until_heard(publisher, "t/a")
    until_heard(publisher, "t/b")
    publisher.publish(message("t/b"))
    assert other.receive(SOON_S) is not None
    assert not news.wait(NEVER_S)


def test_closing_ends_a_wait(pair: tuple[Bus, Bus]) -> None:
    news = pair[1].news("t/*")
    closing = threading.Timer(NEVER_S, news.close)
    closing.start()
    started_s = time.monotonic()
    assert not news.wait(SOON_S)
    assert time.monotonic() - started_s < SOON_S / 2  # it returned because of the close, not of the time
    closing.join()
    assert not news.wait(SOON_S)
    news.close()


def test_news_of_a_closed_bus_or_of_no_expression_is_refused(pair: tuple[Bus, Bus]) -> None:
    with pytest.raises(InputError, match="key expression"):
        pair[1].news("t//a")
    pair[1].close()
    with pytest.raises(ServiceError, match="closed"):
        pair[1].news("t/a")


def test_what_a_daemon_thread_listened_to_leaves_no_thread_behind() -> None:
    """Such a thread would abort the process when the interpreter ends."""
    found: list[threading.Thread] = []

    def listen() -> None:
        before = set(threading.enumerate())
        with ZenohBus(ZenohSettings()) as bus:
            for _ in range(ENDED):
                for heard in (bus.subscribe("t/a"), bus.news("t/a"), bus.queryable("t/a")):
                    heard.close()
                found.extend(thread for thread in threading.enumerate() if thread not in before)

    listening = threading.Thread(target=listen, daemon=True)
    listening.start()
    listening.join()
    assert found == []
