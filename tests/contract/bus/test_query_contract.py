"""What every bus does with questions: the same claims hold in memory and on Zenoh (two sessions over loopback TCP)."""

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from bus_sessions.pairs import NEVER_S, SOON_S
from command_runs.processes import wait_until
from trigpoint.bus.ports import Bus, Content, Query, Queryable, Replies, Reply
from trigpoint.errors import InputError, ServiceError

QUESTION = Content(b"which?", "trigpoint.v1.LandmarksAsked")
ANSWER = Content(b"these", "trigpoint.v1.LandmarksAnswered")
REFUSAL = Content(b"no", "trigpoint.v1.AskRefused")


class Answering(threading.Thread):
    """Takes queries from a queryable and deals with each as told, until the queryable is closed."""

    def __init__(self, queryable: Queryable, deal: Callable[[Query], None]) -> None:
        super().__init__(daemon=True)
        self._queryable, self._deal = queryable, deal
        self.heard: list[Content] = []
        self.start()

    def run(self) -> None:
        while (query := self._queryable.receive(SOON_S)) is not None:
            self.heard.append(query.content)
            with query:
                self._deal(query)


@pytest.fixture
def answering(pair: tuple[Bus, Bus]) -> Iterator[Callable[[str, Callable[[Query], None]], Answering]]:
    """Makes a queryable of the listening session that is dealt with as told, known to the asking one."""
    with ExitStack() as stack:

        def made(expression: str, deal: Callable[[Query], None]) -> Answering:
            queryable = pair[1].queryable(expression)
            thread = Answering(queryable, deal)
            stack.callback(thread.join)
            stack.callback(queryable.close)
            assert pair[0].await_queryable(expression.replace("*", "x"), SOON_S)
            return thread

        yield made


def test_a_reply_arrives_with_everything_it_was_given(
    pair: tuple[Bus, Bus], answering: Callable[..., Answering]
) -> None:
    there = answering("t/ask/*", lambda query: query.reply(ANSWER))
    replies = pair[0].get("t/ask/landmarks", QUESTION, timeout_s=SOON_S)
    assert replies == Replies((Reply("t/ask/landmarks", ANSWER),), whole=True)
    assert there.heard == [QUESTION]


def test_a_refusal_arrives_as_a_reply(pair: tuple[Bus, Bus], answering: Callable[..., Answering]) -> None:
    answering("t/ask", lambda query: query.refuse(REFUSAL))
    replies = pair[0].get("t/ask", QUESTION, timeout_s=SOON_S)
    assert [(reply.content, reply.refused) for reply in replies.items] == [(REFUSAL, True)]


def test_several_replies_on_one_key_arrive_in_order(pair: tuple[Bus, Bus], answering: Callable[..., Answering]) -> None:
    parts = [Content(bytes([number]), media_type="application/geo+json") for number in range(20)]
    answering("t/ask", lambda query: [query.reply(part) for part in parts])
    replies = pair[0].get("t/ask", QUESTION, timeout_s=SOON_S)
    assert [reply.content for reply in replies.items] == parts


def test_everyone_who_matches_is_asked(pair: tuple[Bus, Bus], answering: Callable[..., Answering]) -> None:
    answering("t/a/ask", lambda query: query.reply(ANSWER))
    answering("t/b/ask", lambda query: query.reply(REFUSAL))
    replies = pair[0].get("t/*/ask", QUESTION, timeout_s=SOON_S)
    assert {(reply.key, reply.content) for reply in replies.items} == {("t/a/ask", ANSWER), ("t/b/ask", REFUSAL)}


def test_two_queryables_on_one_key_both_reply(pair: tuple[Bus, Bus], answering: Callable[..., Answering]) -> None:
    answering("t/ask", lambda query: query.reply(ANSWER))
    answering("t/ask", lambda query: query.reply(REFUSAL))
    replies = pair[0].get("t/ask", QUESTION, timeout_s=SOON_S)
    assert sorted(reply.content.payload for reply in replies.items) == [b"no", b"these"]


def test_a_query_closed_without_a_reply_is_whole_and_empty(
    pair: tuple[Bus, Bus], answering: Callable[..., Answering]
) -> None:
    answering("t/ask", lambda query: None)
    assert pair[0].get("t/ask", QUESTION, timeout_s=SOON_S) == Replies((), whole=True)


def test_nobody_to_answer_is_known_at_once(pair: tuple[Bus, Bus]) -> None:
    assert pair[0].get("t/nobody", QUESTION, timeout_s=SOON_S) == Replies((), whole=True)


def test_what_is_not_replied_in_time_is_missing(pair: tuple[Bus, Bus], answering: Callable[..., Answering]) -> None:
    over = threading.Event()

    def partly(query: Query) -> None:
        query.reply(ANSWER)
        over.wait(SOON_S)

    answering("t/ask", partly)
    replies = pair[0].get("t/ask", QUESTION, timeout_s=4 * NEVER_S)
    over.set()
    assert ([reply.content for reply in replies.items], replies.whole) == ([ANSWER], False)


def test_a_closed_queryable_is_asked_no_more(pair: tuple[Bus, Bus]) -> None:
    queryable = pair[1].queryable("t/ask")
    assert pair[0].await_queryable("t/ask", SOON_S)
    queryable.close()
    assert queryable.receive(NEVER_S) is None
    assert pair[0].get("t/ask", QUESTION, timeout_s=SOON_S).items == ()


def test_queries_that_wait_when_a_queryable_is_closed_end_unanswered(pair: tuple[Bus, Bus]) -> None:
    queryable = pair[1].queryable("t/ask")
    assert pair[0].await_queryable("t/ask", SOON_S)
    found: list[Replies] = []
    asking = threading.Thread(target=lambda: found.append(pair[0].get("t/ask", QUESTION, timeout_s=SOON_S)))
    asking.start()
    wait_until(lambda: queryable.waiting > 0, "the query at the queryable")
    queryable.close()
    asking.join()
    assert found == [Replies((), whole=True)]


def test_a_closed_query_takes_no_reply(pair: tuple[Bus, Bus], answering: Callable[..., Answering]) -> None:
    refused = threading.Event()

    def late(query: Query) -> None:
        query.close()
        try:
            query.reply(ANSWER)
        except ServiceError:
            refused.set()

    answering("t/ask", late)
    assert pair[0].get("t/ask", QUESTION, timeout_s=SOON_S).items == ()
    assert refused.wait(SOON_S)


def test_nothing_is_asked_or_answered_on_a_closed_bus(pair: tuple[Bus, Bus]) -> None:
    pair[0].close()
    with pytest.raises(ServiceError, match="closed"):
        pair[0].get("t/ask", QUESTION, timeout_s=SOON_S)
    with pytest.raises(ServiceError, match="closed"):
        pair[0].queryable("t/ask")


def test_a_question_on_no_expression_is_refused(pair: tuple[Bus, Bus]) -> None:
    with pytest.raises(InputError, match="key expression"):
        pair[0].get("t//ask", QUESTION, timeout_s=SOON_S)
