"""What is told of a version that is durable, and what is put together from it."""

from collections.abc import Iterator

import pytest

from landmark_maps.examples import change, checkpoint, landmark
from trigpoint.bus.memory_bus import MemoryBus, MemoryExchange
from trigpoint.bus.ports import BusMessage, Subscription
from trigpoint.errors import InputError
from trigpoint.geodesy.web_tiles import WebTile
from trigpoint.landmarks.memory_store import MemoryStore
from trigpoint.landmarks.model import Landmark
from trigpoint.landmarks.notices import (
    VERSION_SCHEMA,
    StepAssembly,
    decoded_version_change,
    tile_of,
    tile_of_key,
)
from trigpoint_landmarks.change_feed import TOLD_MOST, ChangeFeed, FeedingStore

SOON_S = 20.0
HERE, THERE = landmark("A", 0.0, 0.0), landmark("A", 2_000.0, 0.0)  # some four tiles apart


@pytest.fixture
def told() -> Iterator[tuple[FeedingStore, Subscription]]:
    exchange = MemoryExchange()
    with MemoryBus(exchange) as bus, MemoryBus(exchange) as listening, ChangeFeed(bus, root="t", map_name="m") as feed:
        yield FeedingStore(MemoryStore(), feed), listening.subscribe("t/v1/map/m/changes/**")


def heard(subscription: Subscription) -> list[BusMessage]:
    """The messages of the next step, the version's last."""
    messages: list[BusMessage] = []
    while not messages or messages[-1].schema_name != VERSION_SCHEMA:
        message = subscription.receive(SOON_S)
        assert message is not None
        messages.append(message)
    return messages


def assembled(messages: list[BusMessage], *, without: WebTile | None = None) -> tuple[StepAssembly, BusMessage]:
    assembly = StepAssembly()
    for message in messages[:-1]:
        if tile_of_key(message.key) != without:
            assembly.keep(tile_of_key(message.key), message.payload)
    return assembly, messages[-1]


def moved(told: tuple[FeedingStore, Subscription]) -> list[BusMessage]:
    """What is told of version 2, in which A moves across tiles."""
    store, subscription = told
    store.apply(change(1, opened=[HERE, landmark("B", 1.0, 0.0)]), checkpoint(1))
    heard(subscription)
    store.apply(change(2, opened=[THERE], closed=["A"]), checkpoint(2))
    return heard(subscription)


def ids(landmarks: tuple[Landmark, ...]) -> list[str]:
    return [row.landmark for row in landmarks]


def test_a_version_is_told_last_with_the_one_before_and_its_tiles(told: tuple[FeedingStore, Subscription]) -> None:
    last = decoded_version_change(moved(told)[-1].payload)
    assert (last.before, last.map.map_version, last.tiles) == (1, 2, frozenset({tile_of(HERE), tile_of(THERE)}))


def test_a_landmark_that_moved_across_tiles_is_told_in_both(told: tuple[FeedingStore, Subscription]) -> None:
    messages = moved(told)
    assert {tile_of_key(message.key) for message in messages[:-1]} == {tile_of(HERE), tile_of(THERE)}


def test_all_tiles_together_say_that_it_moved(told: tuple[FeedingStore, Subscription]) -> None:
    assembly, last = assembled(moved(told))
    step = assembly.step(decoded_version_change(last.payload))
    assert step is not None
    assert (step.before, ids(step.changed), step.removed) == (1, ["A"], ())


def test_the_tile_it_left_says_that_it_is_gone(told: tuple[FeedingStore, Subscription]) -> None:
    assembly, last = assembled(moved(told))
    step = assembly.step(decoded_version_change(last.payload), frozenset({tile_of(HERE)}))
    assert step is not None
    assert (step.changed, step.removed) == ((), ("A",))


def test_a_tile_that_did_not_come_is_a_gap(told: tuple[FeedingStore, Subscription]) -> None:
    assembly, last = assembled(moved(told), without=tile_of(THERE))
    assert assembly.step(decoded_version_change(last.payload)) is None


def test_a_tile_that_is_not_followed_is_no_gap(told: tuple[FeedingStore, Subscription]) -> None:
    assembly, last = assembled(moved(told), without=tile_of(THERE))
    assert assembly.step(decoded_version_change(last.payload), frozenset({tile_of(HERE)})) is not None


def test_versions_made_durable_together_are_one_step(told: tuple[FeedingStore, Subscription]) -> None:
    store, subscription = told
    store.apply(change(1, opened=[HERE]), checkpoint(1))
    heard(subscription)
    passing = change(2, opened=[landmark("C", 9.0, 0.0)])
    store.apply_all((passing, change(3, opened=[THERE], closed=["A", "C"])), checkpoint(3))
    assembly, last = assembled(heard(subscription))
    step = assembly.step(decoded_version_change(last.payload))
    assert step is not None
    assert (step.before, step.map.map_version, ids(step.changed), step.removed) == (1, 3, ["A"], ())


def test_too_much_at_once_is_told_by_the_version_alone(told: tuple[FeedingStore, Subscription]) -> None:
    store, subscription = told
    store.apply(change(1, opened=[HERE._replace(landmark=f"L{n}") for n in range(TOLD_MOST + 1)]), checkpoint(1))
    (only,) = heard(subscription)
    assert decoded_version_change(only.payload).tiles is None


def test_a_version_that_is_refused_is_not_told(told: tuple[FeedingStore, Subscription]) -> None:
    store, subscription = told
    store.apply(change(2, opened=[HERE]), checkpoint(2))
    heard(subscription)
    with pytest.raises(InputError):
        store.apply(change(1), checkpoint(3))
    assert subscription.waiting == 0


@pytest.mark.parametrize("key", ["t/v1/map/m/changes/version", "a", "t/1/2/x"])
def test_a_key_without_a_tile_is_refused(key: str) -> None:
    with pytest.raises(InputError, match="does not end with zoom, column and row"):
        tile_of_key(key)
