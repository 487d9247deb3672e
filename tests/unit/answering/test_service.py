"""The answering service over a bus in memory: what it answers, refuses and counts."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest

from landmark_maps.examples import change, checkpoint, landmark
from map_answers.answering import KEY, MAP, ROOT, SOON_S, AnsweredStore, answered, until
from trigpoint.bus.memory_bus import MemoryBus, MemoryExchange
from trigpoint.bus.ports import Content, Reply
from trigpoint.client.asking import MapClient
from trigpoint.errors import InputError
from trigpoint.landmarks.asked import AnswerForm, LandmarkQuestion
from trigpoint.landmarks.memory_store import MemoryStore
from trigpoint.landmarks.messages import decoded_refusal, encoded_question
from trigpoint.landmarks.queries import LandmarkQuery
from trigpoint_landmarks.settings import AnswerSettings

Ask = Callable[[LandmarkQuestion], Reply]
EVERYTHING = LandmarkQuery()


@contextmanager
def served(settings: AnswerSettings | None = None, *, tells: bool = True) -> Iterator[tuple[AnsweredStore, MapClient]]:
    """A map of 30 landmarks that answers, and a client of it."""
    store, exchange = MemoryStore(), MemoryExchange()
    store.apply(change(1, opened=[landmark(f"L{n:02}", 10.0 * n, 5.0) for n in range(30)]), checkpoint(1))
    with (
        MemoryBus(exchange) as bus,
        MemoryBus(exchange) as asking,
        answered(store, bus, settings=settings, tells=tells) as there,
    ):
        yield there, MapClient(asking, root=ROOT, map_name=MAP, timeout_s=SOON_S)


def refused(there: AnsweredStore, reason: str) -> float:
    return float(there.instruments.rejected.labels(vehicle="", reason=reason)._value.get())


def test_the_newest_version_is_answered_from_memory() -> None:
    with served() as (_, client):
        answer = client.landmarks(LandmarkQuery(limit=3))
    assert ([row.landmark for row in answer.landmarks], answer.map.map_version) == (["L00", "L01", "L02"], 1)


def test_an_older_version_is_answered_from_the_store() -> None:
    with served() as (there, client):
        there.store.apply(change(2, closed=["L00"]), checkpoint(2))
        until(lambda: client.landmarks(EVERYTHING).map.map_version == 2)
        assert len(client.landmarks(replace(EVERYTHING, as_of=1)).landmarks) == 30
        assert len(client.landmarks(EVERYTHING).landmarks) == 29


def test_what_nobody_told_of_is_seen_in_the_store() -> None:
    with served(AnswerSettings(look_s=0.01), tells=False) as (there, client):
        there.store.apply(change(2, closed=["L00"]), checkpoint(2))
        until(lambda: client.landmarks(EVERYTHING).map.map_version == 2)
        assert len(client.landmarks(EVERYTHING).landmarks) == 29


def test_pages_stay_in_one_version_while_the_map_goes_on() -> None:
    with served(AnswerSettings(page_landmarks=8)) as (there, client):
        pages = client.pages(EVERYTHING)
        first = next(pages)
        there.store.apply(change(2, closed=[f"L{n:02}" for n in range(20)]), checkpoint(2))
        until(lambda: client.landmarks(EVERYTHING).map.map_version == 2)
        rest = list(pages)
    assert [len(page.landmarks) for page in (first, *rest)] == [8, 8, 8, 6]
    assert {page.map.map_version for page in (first, *rest)} == {1}


def test_a_page_ends_early_where_it_would_be_too_large() -> None:
    with served(AnswerSettings(answer_bytes=1_000)) as (_, client):
        pages = list(client.pages(EVERYTHING))
    assert len(pages) > 3
    assert [row.landmark for page in pages for row in page.landmarks] == [f"L{n:02}" for n in range(30)]


def test_positions_are_given_in_the_crs_that_is_asked_for() -> None:
    with served() as (_, client):
        answer = client.landmarks(LandmarkQuery(limit=1), crs="EPSG:32756")
    (point,) = answer.points
    # The frame's own CRS: its origin and the place in it; positions are given to 0.1 mm.
    assert point == pytest.approx((332_000.0, 6_248_005.0), abs=1e-4)


def test_changes_since_a_version_are_told() -> None:
    with served() as (there, client):
        there.store.apply(change(2, opened=[landmark("L01", 3.0, 3.0)], closed=["L00", "L01"]), checkpoint(2))
        changes = client.changes(1)
    assert ([row.landmark for row in changes.changed], changes.removed, changes.map.map_version) == (
        ["L01"],
        ("L00",),
        2,
    )


def test_geojson_has_the_keys_of_every_other_answer() -> None:
    with served() as (_, client):
        collection = client.geojson(LandmarkQuery(limit=1))
    assert collection["map_version"] == 1
    assert collection["features"][0]["properties"]["sigma_major_m"] == 0.3


@pytest.mark.parametrize(
    ("query", "crs", "reason"),
    [
        (LandmarkQuery(limit=10_001), "", "limit 10001: at most 10000 landmarks are on a page"),
        (LandmarkQuery(as_of=7), "", "map version 7 is unknown: 1 to 1 are there"),
        (EVERYTHING, "+init=file", "is not named by authority and code"),
        (EVERYTHING, "EPSG:999999", "EPSG:999999"),
    ],
)
def test_what_is_outside_the_limits_is_refused_with_them_and_counted(
    query: LandmarkQuery, crs: str, reason: str
) -> None:
    with served() as (there, client):
        with pytest.raises(InputError, match=reason):
            client.landmarks(query, crs=crs)
        assert refused(there, "invalid") == 1


@pytest.mark.parametrize(
    "content",
    [Content(b"\xff\xff", "trigpoint.v1.LandmarksAsked"), Content(b"", "trigpoint.v1.MapSolved"), Content(b"?", "")],
)
def test_what_is_no_question_is_refused(content: Content) -> None:
    with served() as (there, client):
        (reply,) = client.bus.get(KEY, content, timeout_s=SOON_S).items
        assert (reply.refused, decoded_refusal(reply.content.payload).reason) == (True, "invalid")
        assert refused(there, "invalid") == 1


def test_a_question_too_large_is_refused() -> None:
    schema, payload = encoded_question(LandmarkQuestion(query=EVERYTHING, page="x" * 70_000))
    with served() as (_, client):
        (reply,) = client.bus.get(KEY, Content(payload, schema), timeout_s=SOON_S).items
    assert "at most 65536" in decoded_refusal(reply.content.payload).detail


def test_changes_too_large_are_refused_whole() -> None:
    with served(AnswerSettings(answer_bytes=1_000)) as (there, client):
        there.store.apply(change(2, opened=[landmark(f"M{n}", 1.0, 1.0) for n in range(30)]), checkpoint(2))
        with pytest.raises(InputError, match="at most 1000 are sent: ask for a smaller area"):
            client.changes(1)


def test_questions_are_encoded_with_the_form_that_is_asked_for() -> None:
    schema, payload = encoded_question(LandmarkQuestion(query=EVERYTHING, form=AnswerForm.GEOJSON))
    assert (schema, payload) == ("trigpoint.v1.LandmarksAsked", b"\x60\x01")
