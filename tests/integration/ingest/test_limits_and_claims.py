"""Who may send what and how much, and which ingest takes whom."""

import threading
from collections.abc import Iterator
from dataclasses import replace

import pytest

from trigpoint.bus.event_messages import event_message
from trigpoint.bus.memory_bus import MemoryBus, MemoryExchange
from trigpoint.bus.ports import Bus, BusMessage
from trigpoint.errors import ServiceError
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import EventRefused, LandmarkDetection, LandmarksDetected, Observed
from trigpoint.events.uplink import uplink_key
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.observability.metrics import Instruments
from trigpoint_ingest.app import IngestService
from trigpoint_ingest.claims import VehicleClaims
from trigpoint_ingest.settings import IngestSettings

Rows = list[Envelope[Observed]]
SETTINGS = IngestSettings(batch_s=0.0, claim_settle_s=0.0)


@pytest.fixture
def bus() -> Iterator[MemoryBus]:
    with MemoryBus() as opened:
        yield opened


def live(row: Envelope[Observed], *, key_of: str | None = None) -> BusMessage:
    """The row on its vehicle's key, or another's."""
    return event_message(row, key=uplink_key(key_of or row.identity.source, type(row.event)))


def send(rows: Rows, bus: Bus) -> None:
    for row in rows:
        bus.publish(live(row))


def drain(service: IngestService) -> None:
    while service.step(0.0):
        pass
    service.flush()


def acknowledged(bus: Bus, service: IngestService, vehicle: str = "veh-a") -> int:
    """How far the vehicle is acknowledged once everything that came is worked on."""
    heard = bus.subscribe(f"trigpoint/v1/ack/{vehicle}")
    drain(service)
    last = -1
    while (message := heard.receive(0.0)) is not None:
        last = message.identity.sequence
    return last


def refusals(log: MemoryLog) -> list[str]:
    events = [row.envelope.event for row in log.read("refused")]
    return [event.reason for event in events if isinstance(event, EventRefused)]


def stored(log: MemoryLog, vehicle: str = "veh-a") -> list[Envelope[object]]:
    return [row.envelope for row in log.read(f"veh-{vehicle}")]


def test_a_vehicle_that_sends_as_another_is_refused_counted_and_changes_nothing_for_the_other(
    rows: Rows, bus: MemoryBus
) -> None:
    log, instruments = MemoryLog(), Instruments("ingest")
    with IngestService(log, bus, SETTINGS, instruments=instruments) as service:
        send(rows[:5], bus)
        bus.publish(live(rows[5], key_of="veh-b"))
        assert acknowledged(bus, service) == 4
    assert refusals(log) == ["wrong sender"]
    assert stored(log) == rows[:5]
    assert instruments.registry.get_sample_value("trigpoint_refused_access_total") == 1.0


def test_a_message_without_a_number_in_anothers_name_counts_as_nobodys(rows: Rows, bus: MemoryBus) -> None:
    log, instruments = MemoryLog(), Instruments("ingest")
    unnumbered = replace(rows[5], identity=replace(rows[5].identity, sequence=-1))
    with IngestService(log, bus, SETTINGS, instruments=instruments) as service:
        bus.publish(live(unnumbered, key_of="veh-b"))
        drain(service)
    assert refusals(log) == ["wrong sender"]
    labels = {"vehicle": "", "reason": "wrong sender"}
    assert instruments.registry.get_sample_value("trigpoint_rejected_total", labels) == 1.0


def test_what_is_beyond_a_vehicles_rate_is_neither_taken_nor_acknowledged_until_it_comes_again(
    rows: Rows, bus: MemoryBus
) -> None:
    clock = [0.0]
    log, instruments = MemoryLog(), Instruments("ingest")
    settings = replace(SETTINGS, vehicle_rate_hz=10.0, vehicle_burst=20)
    with IngestService(log, bus, settings, instruments=instruments, now_s=lambda: clock[0]) as service:
        send(rows[:50], bus)
        assert acknowledged(bus, service) == 19
        clock[0] += 1.0
        send(rows[20:50], bus)
        assert acknowledged(bus, service) == 29
    assert stored(log) == rows[:30]
    assert instruments.registry.get_sample_value("trigpoint_throttled_total", {"vehicle": "veh-a"}) == 50.0


def test_a_vehicle_beyond_its_rate_slows_no_other_down(rows: Rows, bus: MemoryBus) -> None:
    log = MemoryLog()
    others = [replace(row, identity=replace(row.identity, source="veh-b")) for row in rows[:20]]
    others[0] = replace(others[0], event=replace(others[0].event, vehicle="veh-b"))  # type: ignore[arg-type]
    with IngestService(log, bus, replace(SETTINGS, vehicle_rate_hz=1.0, vehicle_burst=20)) as service:
        send(rows[:50], bus)
        send(others, bus)
        drain(service)
    assert stored(log, "veh-b") == others


def test_a_payload_that_is_too_large_is_refused_and_the_next_goes_on(rows: Rows, bus: MemoryBus) -> None:
    log = MemoryLog()
    many = LandmarksDetected(detections=(LandmarkDetection(1.0, 0.0, "pole", "", 0.1),) * 40)
    large = replace(rows[5], event=many)
    with IngestService(log, bus, replace(SETTINGS, message_limit_bytes=1000)) as service:
        send([*rows[:5], large, *rows[6:10]], bus)
        assert acknowledged(bus, service) == 9
    assert refusals(log) == ["too large"]
    assert stored(log) == [*rows[:5], *rows[6:10]]


def test_drives_beyond_the_limit_are_neither_taken_nor_acknowledged_and_known_ones_go_on(
    rows: Rows, bus: MemoryBus
) -> None:
    log = MemoryLog()
    second = [replace(row, identity=replace(row.identity, boot_id="boot-2")) for row in rows[:5]]
    with IngestService(log, bus, replace(SETTINGS, drive_limit=1)) as service:
        send([*rows[:5], *second, *rows[5:10]], bus)
        assert acknowledged(bus, service) == 9
    assert stored(log) == rows[:10]


def test_names_beyond_the_limit_are_not_heard(rows: Rows, bus: MemoryBus) -> None:
    log = MemoryLog()
    with IngestService(log, bus, replace(SETTINGS, name_limit=1)) as service:
        send(rows[:5], bus)
        bus.publish(live(replace(rows[0], identity=EventIdentity("veh-z", "boot-1", 0))))
        drain(service)
    assert (len(stored(log)), refusals(log)) == (5, [])


def test_an_ingest_of_some_vehicles_hears_no_others(rows: Rows, bus: MemoryBus) -> None:
    log = MemoryLog()
    others = replace(rows[0], identity=EventIdentity("veh-b", "boot-1", 0))
    with IngestService(log, bus, replace(SETTINGS, vehicles=("veh-a",))) as service:
        send([*rows[:5], others], bus)
        drain(service)
    assert "veh-veh-b" not in log.streams()
    assert stored(log) == rows[:5]


@pytest.mark.parametrize(
    ("first", "second"), [((), ()), (("veh-a",), ("veh-b", "veh-a")), ((), ("veh-a",)), (("veh-a",), ())]
)
def test_a_claim_made_twice_is_refused_to_the_later_ingest(first: tuple[str, ...], second: tuple[str, ...]) -> None:
    exchange = MemoryExchange()
    with MemoryBus(exchange) as one, MemoryBus(exchange) as other:
        earlier = IngestService(MemoryLog(), one, replace(SETTINGS, vehicles=first))
        with pytest.raises(ServiceError, match="cannot be claimed: another ingest holds trigpoint/v1/live/ingest"):
            IngestService(MemoryLog(), other, replace(SETTINGS, vehicles=second))
        run_for_a_moment(earlier)
        earlier.close()


def test_ingests_of_different_vehicles_work_side_by_side() -> None:
    exchange = MemoryExchange()
    with (
        MemoryBus(exchange) as one,
        MemoryBus(exchange) as other,
        IngestService(MemoryLog(), one, replace(SETTINGS, vehicles=("veh-a",))) as first,
        IngestService(MemoryLog(), other, replace(SETTINGS, vehicles=("veh-b",))) as second,
    ):
        run_for_a_moment(first)
        run_for_a_moment(second)


class CountingBus(MemoryBus):
    """A bus that counts the looks at claims."""

    looks = 0

    def claimed(self, key_expression: str) -> tuple[str, ...]:
        self.looks += 1
        return super().claimed(key_expression)


def test_claims_are_looked_at_twice_however_many_vehicles_there_are() -> None:
    with CountingBus() as bus:
        VehicleClaims(bus, [f"veh-{number}" for number in range(100)]).require()
        assert bus.looks == 2


def test_what_a_closed_ingest_claimed_is_free() -> None:
    with MemoryBus() as bus:
        IngestService(MemoryLog(), bus, SETTINGS).close()
        IngestService(MemoryLog(), bus, SETTINGS).close()


def run_for_a_moment(service: IngestService) -> None:
    """It begins to work, and would say so if another's claim were in its way."""
    stop = threading.Event()
    stop.set()
    service.run(stop)
