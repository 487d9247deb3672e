"""What every bus does: the same claims hold in memory and on Zenoh (two sessions over loopback TCP)."""

import threading
import time

import pytest

from bus_sessions.pairs import NEVER_S, SMALL_INBOX, SOON_S, free_endpoint, message, until_heard
from command_runs.processes import wait_until
from trigpoint.bus.arrivals import messages_of_run, run_of_messages
from trigpoint.bus.ports import UNIDENTIFIED, Bus, BusMessage, Subscription
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings
from trigpoint.errors import InputError, ServiceError


def until_lost(subscription: Subscription, count: int) -> None:
    wait_until(lambda: subscription.lost >= count, f"{count} lost")


def until_waiting(subscription: Subscription, count: int) -> None:
    wait_until(lambda: subscription.waiting >= count, f"{count} waiting")


def until_claimed(bus: Bus, expression: str, keys: tuple[str, ...]) -> None:
    """A claim or its end takes a moment to travel."""
    wait_until(lambda: bus.claimed(expression) == keys, f"{keys} claimed")


def received_in_runs(subscription: Subscription, count: int) -> list[BusMessage]:
    received: list[BusMessage] = []
    while len(received) < count and (found := subscription.receive_run(SOON_S)) is not None:
        received += messages_of_run(found)
    return received


def all_received(subscription: Subscription, count: int) -> list[BusMessage]:
    received = [subscription.receive(SOON_S) for _ in range(count)]
    return [item for item in received if item is not None]


def on_two_keys() -> list[BusMessage]:
    """Messages on t/a and t/b in turn."""
    return [message(f"t/{'ab'[sequence % 2]}", sequence) for sequence in range(SMALL_INBOX)]


def assert_each_key_in_order(received: list[BusMessage], sent: list[BusMessage]) -> None:
    for key in ("t/a", "t/b"):
        assert [item for item in received if item.key == key] == [item for item in sent if item.key == key]


def test_a_message_arrives_with_everything_it_was_sent_with(pair: tuple[Bus, Bus]) -> None:
    publisher, listener = pair
    subscription = listener.subscribe("t/v1/veh/*/obs/*")
    until_heard(publisher, "t/v1/veh/a/obs/gnss")
    publisher.publish(message("t/v1/veh/a/obs/gnss"))
    assert subscription.receive(SOON_S) == message("t/v1/veh/a/obs/gnss")


def test_one_publishers_messages_on_a_key_keep_their_order(pair: tuple[Bus, Bus]) -> None:
    publisher, listener = pair
    subscription = listener.subscribe("t/**")
    until_heard(publisher, "t/a")
    sent = [message("t/a", sequence) for sequence in range(SMALL_INBOX)]
    for item in sent:
        publisher.publish(item)
    assert all_received(subscription, len(sent)) == sent


def test_messages_published_together_arrive_one_by_one_each_key_in_order(pair: tuple[Bus, Bus]) -> None:
    publisher, listener = pair
    subscription = listener.subscribe("t/*")
    until_heard(publisher, "t/a")
    sent = on_two_keys()
    publisher.publish_all(sent)
    received = all_received(subscription, len(sent))
    assert_each_key_in_order(received, sent)


def test_what_is_published_together_can_be_received_as_runs(pair: tuple[Bus, Bus]) -> None:
    publisher, listener = pair
    subscription = listener.subscribe("t/*")
    until_heard(publisher, "t/a")
    sent = [message("t/a", sequence) for sequence in range(SMALL_INBOX)]
    publisher.publish_all(sent)
    assert received_in_runs(subscription, len(sent)) == sent


def test_a_run_arrives_as_the_messages_it_holds(pair: tuple[Bus, Bus]) -> None:
    publisher, listener = pair
    subscription = listener.subscribe("t/*")
    until_heard(publisher, "t/a")
    sent = [message("t/a", sequence) for sequence in range(SMALL_INBOX)]
    publisher.publish_run(run_of_messages(sent))
    assert all_received(subscription, len(sent)) == sent


def test_the_rest_of_a_bundle_can_be_received_as_a_run(pair: tuple[Bus, Bus]) -> None:
    publisher, listener = pair
    subscription = listener.subscribe("t/*")
    until_heard(publisher, "t/a")
    sent = [message("t/a", sequence) for sequence in range(SMALL_INBOX)]
    publisher.publish_all(sent)
    first = all_received(subscription, 1)
    assert first + received_in_runs(subscription, len(sent) - 1) == sent


def test_runs_of_several_keys_keep_each_keys_order(pair: tuple[Bus, Bus]) -> None:
    publisher, listener = pair
    subscription = listener.subscribe("t/*")
    until_heard(publisher, "t/a")
    sent = on_two_keys()
    for item in sent:
        publisher.publish(item)
    until_waiting(subscription, len(sent))
    received = received_in_runs(subscription, len(sent))
    assert_each_key_in_order(received, sent)


def test_what_is_left_of_runs_can_be_received_one_by_one(pair: tuple[Bus, Bus]) -> None:
    publisher, listener = pair
    subscription = listener.subscribe("t/*")
    until_heard(publisher, "t/a")
    sent = on_two_keys()
    for item in sent:
        publisher.publish(item)
    until_waiting(subscription, len(sent))
    received = received_in_runs(subscription, 1)
    assert subscription.waiting == len(sent) - len(received)
    received += all_received(subscription, len(sent) - len(received))
    assert_each_key_in_order(received, sent)
    assert subscription.waiting == 0


def test_what_waits_is_counted(pair: tuple[Bus, Bus]) -> None:
    publisher, listener = pair
    subscription = listener.subscribe("t/a")
    until_heard(publisher, "t/a")
    publisher.publish_all([message("t/a", sequence) for sequence in range(3)])
    until_waiting(subscription, 3)
    assert subscription.waiting == 3
    assert subscription.waiting_bytes >= 3 * len(message("t/a").payload)


def test_a_claim_is_seen_by_both_sessions_until_it_is_released(pair: tuple[Bus, Bus]) -> None:
    claiming, looking = pair
    claim = claiming.claim("t/live/a/1")
    until_claimed(looking, "t/live/*/*", ("t/live/a/1",))
    assert claiming.claimed("t/live/a/*") == ("t/live/a/1",)
    claim.release()
    until_claimed(looking, "t/live/*/*", ())
    assert looking.claimed("t/live/*/*") == ()


def test_two_claims_of_a_name_are_both_seen(pair: tuple[Bus, Bus]) -> None:
    pair[0].claim("t/live/a/2")
    pair[1].claim("t/live/a/1")
    both = ("t/live/a/1", "t/live/a/2")
    until_claimed(pair[0], "t/live/a/*", both)
    assert pair[0].claimed("t/live/a/*") == both


def test_closing_a_bus_releases_its_claims(pair: tuple[Bus, Bus]) -> None:
    pair[0].claim("t/live/a/1")
    until_claimed(pair[1], "t/live/a/*", ("t/live/a/1",))
    pair[0].close()
    until_claimed(pair[1], "t/live/a/*", ())
    assert pair[1].claimed("t/live/a/*") == ()


def test_a_claim_of_a_key_that_cannot_be_published_is_refused(pair: tuple[Bus, Bus]) -> None:
    with pytest.raises(InputError, match="key"):
        pair[0].claim("t/*")


def test_what_is_lost_together_is_counted_one_by_one(pair: tuple[Bus, Bus]) -> None:
    publisher, listener = pair
    subscription = listener.subscribe("t/a")
    until_heard(publisher, "t/a")
    for sequence in range(SMALL_INBOX):
        publisher.publish(message("t/a", sequence))
    publisher.publish_all([message("t/a", 100 + sequence) for sequence in range(7)])
    until_lost(subscription, 7)
    assert subscription.lost == 7


def test_a_subscription_hears_only_what_its_expression_matches(pair: tuple[Bus, Bus]) -> None:
    publisher, listener = pair
    subscription = listener.subscribe("t/v1/ack/*")
    until_heard(publisher, "t/v1/ack/a")
    publisher.publish(message("t/v1/veh/a/obs/gnss", 1))
    publisher.publish(message("t/v1/ack/a", 2))
    assert [item.identity.sequence for item in all_received(subscription, 1)] == [2]
    assert subscription.receive(NEVER_S) is None


def test_two_subscriptions_each_hear_a_message(pair: tuple[Bus, Bus]) -> None:
    publisher, listener = pair
    first, second = listener.subscribe("t/a"), listener.subscribe("t/*")
    until_heard(publisher, "t/a")
    publisher.publish(message("t/a"))
    assert first.receive(SOON_S) == second.receive(SOON_S) == message("t/a")


def test_a_session_hears_itself(pair: tuple[Bus, Bus]) -> None:
    publisher, _ = pair
    subscription = publisher.subscribe("t/a")
    publisher.publish(message("t/a"))
    assert subscription.receive(SOON_S) == message("t/a")


def test_a_full_inbox_loses_the_newest_and_says_how_many(pair: tuple[Bus, Bus]) -> None:
    publisher, listener = pair
    subscription = listener.subscribe("t/a")
    until_heard(publisher, "t/a")
    for sequence in range(SMALL_INBOX + 7):
        publisher.publish(message("t/a", sequence))
    until_lost(subscription, 7)
    assert subscription.lost == 7
    assert [item.identity.sequence for item in all_received(subscription, SMALL_INBOX)] == list(range(SMALL_INBOX))


def test_nothing_is_received_when_nothing_comes(pair: tuple[Bus, Bus]) -> None:
    assert pair[1].subscribe("t/a").receive(NEVER_S) is None


def test_a_closed_subscription_hears_no_more(pair: tuple[Bus, Bus]) -> None:
    publisher, _ = pair
    subscription = publisher.subscribe("t/a")
    publisher.publish(message("t/a"))
    subscription.close()
    assert subscription.receive(NEVER_S) is None


def test_nobody_listens_where_nobody_subscribed(pair: tuple[Bus, Bus]) -> None:
    assert not pair[0].has_listener("t/a")
    assert not pair[0].await_listener("t/a", NEVER_S)


def test_a_listener_that_comes_is_noticed(pair: tuple[Bus, Bus]) -> None:
    publisher, listener = pair
    coming = threading.Timer(NEVER_S, listener.subscribe, args=("t/*",))
    coming.start()
    assert publisher.await_listener("t/a", SOON_S)
    coming.join()


@pytest.mark.parametrize("key", ["", "/t", "t/", "t//a", "t/*", "t/**/a", "t/a?b", "t/#", "t/$a", "t/@a"])
def test_a_key_with_an_empty_chunk_or_a_reserved_character_is_refused(pair: tuple[Bus, Bus], key: str) -> None:
    with pytest.raises(InputError, match="key"):
        pair[0].publish(message(key))


@pytest.mark.parametrize("expression", ["", "t//a", "t/a*", "t/$*", "t/**/**", "t/?"])
def test_an_expression_that_is_not_well_formed_is_refused(pair: tuple[Bus, Bus], expression: str) -> None:
    with pytest.raises(InputError, match="key expression"):
        pair[0].subscribe(expression)


def test_a_closed_bus_refuses_to_publish(pair: tuple[Bus, Bus]) -> None:
    pair[0].close()
    with pytest.raises(ServiceError, match="closed"):
        pair[0].publish(message("t/a"))


def test_a_closed_bus_refuses_to_subscribe(pair: tuple[Bus, Bus]) -> None:
    pair[0].close()
    with pytest.raises(ServiceError, match="closed"):
        pair[0].subscribe("t/a")


def test_closing_twice_is_closing_once(pair: tuple[Bus, Bus]) -> None:
    pair[0].close()
    pair[0].close()


def test_closing_a_bus_wakes_whoever_waits_on_it(pair: tuple[Bus, Bus]) -> None:
    subscription = pair[0].subscribe("t/a")
    pair[0].close()
    started_s = time.monotonic()
    assert subscription.receive(SOON_S) is None
    assert time.monotonic() - started_s < SOON_S / 2  # it returned because of the close, not of the time


@pytest.mark.parametrize("attachment", [None, b"\x02\x00\x00\x00\x00", b"\x02\xff\xff\xff\xff"])
@pytest.mark.parametrize("payload", [b"hello", b""])
def test_a_foreign_message_arrives_as_unidentified(payload: bytes, attachment: bytes | None) -> None:
    zenoh = pytest.importorskip("zenoh")
    endpoint = free_endpoint()
    with ZenohBus(ZenohSettings(listen=(endpoint,))) as bus:
        subscription = bus.subscribe("t/a")
        config = zenoh.Config()
        config.insert_json5("connect/endpoints", f'["{endpoint}"]')
        config.insert_json5("scouting/multicast/enabled", "false")
        with zenoh.open(config) as stranger, stranger.declare_publisher("t/a") as publisher:
            wait_until(lambda: publisher.matching_status.matching, "the subscription known")
            publisher.put(payload, attachment=attachment)
            received = subscription.receive(SOON_S)
    assert received is not None
    assert (received.identity, received.payload) == (UNIDENTIFIED, payload)
