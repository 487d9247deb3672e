"""A vehicle's live messages, lost, doubled and out of order on the way, are each in the log once and in order."""

import random
import socket
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Self

import pytest

from trigpoint.bus.memory_bus import MemoryBus, MemoryExchange
from trigpoint.bus.ports import Bus, BusMessage, BusRun, Claim, Content, News, Queryable, Replies, Subscription
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings
from trigpoint.errors import AppendFailed, LogDamaged, ServiceError
from trigpoint.events.codec import schema_name
from trigpoint.events.envelope import Envelope, EventIdentity, LogPosition
from trigpoint.events.keys import key_expression
from trigpoint.events.mapped import MapSolved
from trigpoint.events.observed import EventRefused, GnssFixReceived, Observed
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.ports import EventLog, RecallingLog
from trigpoint_ingest.app import IngestService
from trigpoint_ingest.settings import IngestSettings
from trigpoint_vehicle.replay import ReplaySettings, replay_log, replay_rows

Rows = list[Envelope[Observed]]
SETTINGS = IngestSettings(live_batch_count=200, batch_s=0.02)
PATIENT = ReplaySettings(window=500, ack_timeout_s=0.2, attempts=50)


def messages_of_run(run: BusRun) -> list[BusMessage]:
    """The run's messages one by one."""
    with MemoryBus() as bus:
        subscription = bus.subscribe(run.key)
        bus.publish_run(run)
        return received(subscription)


class LossyBus:
    """A bus whose publications are lost, doubled or delayed behind later ones, by a seeded die."""

    def __init__(self, bus: Bus, *, seed: int) -> None:
        self._bus = bus
        self._die = random.Random(seed)
        self._delayed: list[BusMessage] = []

    def publish(self, message: BusMessage) -> None:
        fate = self._die.random()
        if fate < 0.05:  # lost
            return
        if fate < 0.15:  # delayed behind one to twenty others
            self._delayed.append(message)
        else:
            for _ in range(2 if fate < 0.25 else 1):  # doubled
                self._bus.publish(message)
        if len(self._delayed) > self._die.randint(1, 20):
            for delayed in self._delayed:
                self._bus.publish(delayed)
            self._delayed.clear()

    def publish_all(self, messages: Sequence[BusMessage]) -> None:
        for message in messages:
            self.publish(message)

    def publish_run(self, run: BusRun) -> None:
        self.publish_all(messages_of_run(run))

    def subscribe(self, key_expression: str) -> Subscription:
        return self._bus.subscribe(key_expression)

    def news(self, key_expression: str) -> News:
        return self._bus.news(key_expression)

    def claim(self, key: str) -> Claim:
        return self._bus.claim(key)

    def claimed(self, key_expression: str) -> tuple[str, ...]:
        return self._bus.claimed(key_expression)

    def has_listener(self, key: str) -> bool:
        return self._bus.has_listener(key)

    def await_listener(self, key: str, timeout_s: float) -> bool:
        return self._bus.await_listener(key, timeout_s)

    def queryable(self, key_expression: str) -> Queryable:
        return self._bus.queryable(key_expression)

    def get(self, key_expression: str, content: Content, *, timeout_s: float) -> Replies:
        return self._bus.get(key_expression, content, timeout_s=timeout_s)

    def await_queryable(self, key: str, timeout_s: float) -> bool:
        return self._bus.await_queryable(key, timeout_s)

    def close(self) -> None:
        self._bus.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


@pytest.fixture(params=["memory", "zenoh"])
def buses(request: pytest.FixtureRequest) -> Iterator[tuple[Bus, Bus]]:
    """The vehicle's session and ingest's."""
    with ExitStack() as stack:
        if request.param == "memory":
            exchange = MemoryExchange()
            pair: list[Bus] = [MemoryBus(exchange), MemoryBus(exchange)]
        else:
            with socket.socket() as probe:
                probe.bind(("127.0.0.1", 0))
                endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
            ingest = ZenohBus(ZenohSettings(listen=(endpoint,)))
            pair = [ZenohBus(ZenohSettings(connect=(endpoint,))), ingest]
        for bus in pair:
            stack.enter_context(bus)
        yield pair[0], pair[1]


@contextmanager
def running(log: RecallingLog, bus: Bus, settings: IngestSettings = SETTINGS) -> Iterator[IngestService]:
    """Ingest at work in a thread of its own; closed, and thereby flushed, at the end."""
    stop = threading.Event()
    with IngestService(log, bus, settings) as service:
        thread = threading.Thread(target=service.run, args=(stop,))
        thread.start()
        try:
            yield service
        finally:
            stop.set()
            thread.join()


def stored(log: EventLog, vehicle: str = "veh-a") -> list[Envelope[object]]:
    return [row.envelope for row in log.read(f"veh-{vehicle}")]


@pytest.mark.parametrize("seed", [1, 2])
def test_what_is_lost_doubled_and_reordered_ends_in_the_log_once_and_in_order(
    buses: tuple[Bus, Bus], rows: Rows, log: McapLog, seed: int
) -> None:
    vehicle, ingest = buses
    with running(log, ingest) as service:
        report = replay_rows(rows, LossyBus(vehicle, seed=seed), settings=PATIENT)
    assert stored(log) == rows
    assert report.messages == service.report().accepted == len(rows)
    assert report.resent > 0
    assert service.report().duplicates > 0


def test_a_vehicle_log_is_replayed_as_it_is(
    buses: tuple[Bus, Bus], vehicle_log: Path, rows: Rows, log: McapLog
) -> None:
    with running(log, buses[1]):
        report = replay_log(vehicle_log, buses[0])
    assert stored(log) == rows
    assert (report.vehicle, report.messages) == ("veh-a", len(rows))


def test_the_whole_messages_of_a_damaged_log_are_all_in_before_the_damage_is_told(
    vehicle_log: Path, rows: Rows, log: McapLog
) -> None:
    vehicle_log.write_bytes(vehicle_log.read_bytes()[:-20])  # the end of the footer
    bus = MemoryBus()
    with running(log, bus), pytest.raises(LogDamaged):
        replay_log(vehicle_log, bus, settings=PATIENT)
    assert stored(log) == rows
    bus.close()


def test_a_bad_live_message_is_refused_acknowledged_and_blocks_nothing(
    buses: tuple[Bus, Bus], rows: Rows, log: McapLog
) -> None:
    event = rows[10].event
    assert isinstance(event, GnssFixReceived)
    bad = replace(rows[10], event=replace(event, lat_deg=91.0))
    with running(log, buses[1]):
        replay_rows([*rows[:10], bad, *rows[11:50]], buses[0], settings=PATIENT)
    assert stored(log) == [*rows[:10], *rows[11:50]]
    (kept,) = [row.envelope.event for row in log.read("refused")]
    assert isinstance(kept, EventRefused)
    assert kept.reason == "out of range"


def test_an_event_is_in_the_log_before_anyone_hears_of_it(buses: tuple[Bus, Bus], rows: Rows) -> None:
    log = MemoryLog()
    vehicle, ingest = buses
    heard = vehicle.subscribe(key_expression(GnssFixReceived))
    with running(log, ingest):
        replay_rows(rows[:11], vehicle, settings=PATIENT)
        fix = heard.receive(5.0)
    assert fix is not None
    assert fix.key == "trigpoint/v1/veh/veh-a/obs/gnss"
    assert fix.identity in [row.identity for row in stored(log)]


def test_two_vehicles_at_once_are_each_complete_and_in_order(buses: tuple[Bus, Bus], rows: Rows, log: McapLog) -> None:
    described = replace(rows[0].event, vehicle="veh-b")  # type: ignore[arg-type]  # a VehicleDescribed
    others = [replace(row, identity=replace(row.identity, source="veh-b")) for row in rows]
    others[0] = replace(others[0], event=described)
    with running(log, buses[1]):
        second = threading.Thread(target=replay_rows, args=(others, buses[0]), kwargs={"settings": PATIENT})
        second.start()
        replay_rows(rows, buses[0], settings=PATIENT)
        second.join()
    assert stored(log) == rows
    assert stored(log, "veh-b") == others


def test_after_a_restart_what_is_sent_again_changes_nothing(rows: Rows, tmp_path: Path) -> None:
    bus = MemoryBus()
    for _ in range(2):
        log = McapLog(tmp_path / "log")
        with running(log, bus):
            replay_rows(rows, bus, settings=PATIENT)
        log.close()
    assert stored(McapLog(tmp_path / "log")) == rows


def test_a_live_drive_goes_on_after_a_restart(rows: Rows, tmp_path: Path) -> None:
    bus = MemoryBus()
    for part in (rows[:1000], rows[1000:]):
        log = McapLog(tmp_path / "log")
        with running(log, bus):
            replay_rows(part, bus, settings=PATIENT)
        log.close()
    assert stored(McapLog(tmp_path / "log")) == rows


class FullLog(MemoryLog):
    """A log whose disk is full after some events."""

    def append(self, stream: str, rows: object) -> LogPosition:
        if self.next_number(stream) > 100:
            raise AppendFailed("no space left")
        return super().append(stream, rows)  # type: ignore[arg-type]


def test_nothing_is_acknowledged_that_could_not_be_appended(rows: Rows) -> None:
    bus = MemoryBus()
    heard = bus.subscribe("trigpoint/v1/ack/*")
    log = FullLog()
    service = IngestService(log, bus, SETTINGS)
    send(rows[:150], bus)
    drain(service)
    send(rows[150:400], bus)
    with pytest.raises(AppendFailed):
        drain(service)
    acknowledged = [heard_last.identity.sequence for heard_last in received(heard)]
    assert max(acknowledged) == len(stored(log)) - 1 == 149
    bus.close()


def test_an_append_that_failed_is_tried_again_before_anything_is_acknowledged(rows: Rows) -> None:
    bus = MemoryBus()
    log = FullLog()
    service = IngestService(log, bus, SETTINGS)
    heard = bus.subscribe("trigpoint/v1/ack/*")
    send(rows[:150], bus)
    drain(service)
    send(rows[150:400], bus)
    with pytest.raises(AppendFailed):
        drain(service)
    with pytest.raises(AppendFailed):
        service.close()
    assert max(message.identity.sequence for message in received(heard)) == len(stored(log)) - 1 == 149
    bus.close()


def test_a_gap_is_given_up_after_a_while_and_what_waited_goes_in(rows: Rows) -> None:
    bus = MemoryBus()
    log = MemoryLog()
    service = IngestService(log, bus, replace(SETTINGS, gap_timeout_s=0.0, batch_s=0.0))
    for row in (*rows[:5], *rows[6:10]):
        bus.publish(live(row))
    heard = bus.subscribe("trigpoint/v1/ack/*")
    drain(service)
    service.close()
    assert stored(log) == [*rows[:5], *rows[6:10]]
    assert {message.identity.sequence for message in received(heard)} == {4}  # never past what is missing
    bus.close()


def test_old_messages_sent_again_do_not_prolong_the_wait_for_a_missing_one(rows: Rows) -> None:
    now_s = [0.0]
    bus, log = MemoryBus(), MemoryLog()
    service = IngestService(log, bus, replace(SETTINGS, gap_timeout_s=30.0), now_s=lambda: now_s[0])
    send([*rows[:5], *rows[6:10]], bus)
    drain(service)
    for now_s[0] in (8.0, 16.0, 24.0, 32.0):
        send(rows[:5], bus)
        drain(service)
    assert stored(log) == [*rows[:5], *rows[6:10]]
    bus.close()


def test_a_gap_of_a_vehicle_that_is_cut_off_waits_for_its_link(rows: Rows) -> None:
    now_s = [0.0]
    bus, log = MemoryBus(), MemoryLog()
    service = IngestService(log, bus, replace(SETTINGS, gap_timeout_s=30.0), now_s=lambda: now_s[0])
    send([*rows[:5], *rows[6:10]], bus)
    drain(service)
    now_s[0] = 100.0  # not heard for longer than any gap may last
    drain(service)
    send(rows[10:12], bus)  # the link is back, and what is missing comes last
    drain(service)
    send(rows[5:6], bus)
    drain(service)
    assert stored(log) == rows[:12]
    bus.close()


def test_messages_that_find_no_room_behind_a_missing_one_are_told_of(
    rows: Rows, caplog: pytest.LogCaptureFixture
) -> None:
    bus = MemoryBus()
    with IngestService(MemoryLog(), bus, replace(SETTINGS, held_limit=2)) as service:
        for row in (rows[0], *rows[2:7]):
            bus.publish(live(row))
        drain(service)
    assert "3 messages lost to a full queue" in caplog.text
    bus.close()


def test_a_message_of_no_one_is_kept_aside(rows: Rows) -> None:
    bus = MemoryBus()
    log = MemoryLog()
    with IngestService(log, bus, SETTINGS) as service:
        bus.publish(replace(live(rows[0]), identity=EventIdentity("", "", -1)))
        drain(service)
    (kept,) = [row.envelope.event for row in log.read("refused")]
    assert isinstance(kept, EventRefused)
    assert kept.reason == "unidentified"
    bus.close()


def test_a_message_in_a_schema_no_vehicle_sends_keeps_none_of_those_beside_it_back(rows: Rows) -> None:
    bus, log = MemoryBus(), MemoryLog()
    with IngestService(log, bus, SETTINGS) as service:
        send(rows[:100], bus)
        drain(service)
        send(rows[100:200], bus)
        bus.publish(replace(live(rows[200]), schema_name=schema_name(MapSolved)))
        drain(service)
    assert stored(log) == rows[:200]
    assert len(list(log.read("refused"))) == 1
    bus.close()


def test_a_replay_that_nobody_hears_says_so(rows: Rows) -> None:
    with MemoryBus() as bus, pytest.raises(ServiceError, match="nobody listens to trigpoint/v1/veh/veh-a/up/"):
        replay_rows(rows, bus, settings=replace(PATIENT, listener_timeout_s=0.01))


def test_a_replay_that_nobody_acknowledges_says_so(rows: Rows) -> None:
    with MemoryBus() as bus:
        bus.subscribe("trigpoint/v1/veh/*/up/*")
        with pytest.raises(ServiceError, match="20 messages unacknowledged after 3 times"):
            replay_rows(rows[:20], bus, settings=replace(PATIENT, ack_timeout_s=0.01, attempts=2))


class DeafEarBus(MemoryBus):
    """A bus whose vehicle is acknowledged once a message was sent three times."""

    def __init__(self) -> None:
        super().__init__()
        self._sent = 0

    def publish_run(self, run: BusRun) -> None:
        last = messages_of_run(run)[-1]
        self._sent += last.identity.sequence == 19
        if self._sent == 3:
            self.publish(replace(last, key="trigpoint/v1/ack/veh-a"))


def test_an_acknowledgement_of_the_last_attempt_counts(rows: Rows) -> None:
    with DeafEarBus() as bus:
        bus.subscribe("trigpoint/v1/veh/*/up/*")
        report = replay_rows(rows[:20], bus, settings=replace(PATIENT, ack_timeout_s=0.01, attempts=2))
    assert report.resent == 40


def live(row: Envelope[Observed]) -> BusMessage:
    """The message the row's vehicle would send."""
    with MemoryBus() as bus:
        subscription = bus.subscribe("trigpoint/v1/veh/*/up/*")
        with pytest.raises(ServiceError):
            replay_rows([row], bus, settings=ReplaySettings(ack_timeout_s=0.0, attempts=1))
        message = subscription.receive(0.0)
    assert message is not None
    return message


def send(rows: Rows, bus: Bus) -> None:
    for row in rows:
        bus.publish(live(row))


def send_again(rows: Rows, bus: Bus, service: IngestService, *, times: int) -> None:
    for _ in range(times):
        send(rows, bus)
        drain(service)


def drain(service: IngestService) -> None:
    while service.step(0.0):
        pass
    service.flush()


def received(subscription: Subscription) -> list[BusMessage]:
    messages = []
    while message := subscription.receive(0.0):
        messages.append(message)
    return messages
