"""A vehicle's publisher against real ingest: what is dropped is on record, and holds up nothing behind it."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from trigpoint.bus.memory_bus import MemoryBus, MemoryExchange
from trigpoint.events.envelope import Envelope
from trigpoint.events.observed import EventRefused, ImuMeasured, VehicleDescribed
from trigpoint.events.uplink import DROPPED_SCHEMA
from trigpoint.logs.mcap_log import McapLog
from trigpoint_ingest.app import IngestService
from trigpoint_ingest.settings import IngestSettings
from trigpoint_vehicle.publisher import VehiclePublisher
from trigpoint_vehicle.settings import VehicleSettings

SMALL = VehicleSettings(segment_bytes=4096, spool_limit_bytes=40_960, when_full="drop oldest")
SOON_S = 60.0
START_NS = 1_700_000_000_000_000_000
STEP_NS = 10_000_000


@contextmanager
def ingesting(log: McapLog, exchange: MemoryExchange) -> Iterator[None]:
    stop = threading.Event()
    with MemoryBus(exchange) as bus, IngestService(log, bus, IngestSettings(batch_s=0.02)) as service:
        thread = threading.Thread(target=service.run, args=(stop,))
        thread.start()
        try:
            yield
        finally:
            stop.set()
            thread.join()


def drive(publisher: VehiclePublisher, count: int) -> None:
    """A described vehicle and so many measurements, the time going on from boot to boot."""
    publisher.describe(VehicleDescribed(vehicle="veh-a"), stamp_ns=START_NS)
    for number in range(1, count):
        event = ImuMeasured(yaw_rate_radps=0.0, acceleration_x_mps2=1e-3 * number, acceleration_y_mps2=0.0)
        publisher.send(event, stamp_ns=START_NS + number * STEP_NS)


def stored(log: McapLog, stream: str) -> list[Envelope[object]]:
    return [row.envelope for row in log.read(stream)]


def test_what_a_full_spool_dropped_is_refused_under_its_numbers_and_the_rest_is_in_the_log(tmp_path: Path) -> None:
    exchange, log = MemoryExchange(), McapLog(tmp_path / "log")
    with MemoryBus(exchange) as bus, VehiclePublisher("veh-a", tmp_path / "spool", bus, SMALL) as publisher:
        drive(publisher, 2000)
        dropped = publisher.sent.dropped
        with ingesting(log, exchange):
            assert publisher.flush(SOON_S)
    refused = [one.event for one in stored(log, "refused")]
    kept = [one.identity.sequence for one in stored(log, "veh-veh-a")]
    log.close()
    assert dropped > 0
    assert [one.schema_name for one in refused if isinstance(one, EventRefused)] == [DROPPED_SCHEMA] * dropped
    assert kept == sorted(set(kept))
    assert (kept[0], kept[-1], len(kept) + dropped) == (0, 1999, 2000)


def test_ingest_that_comes_after_a_restart_gets_both_boots_whole_and_in_order(tmp_path: Path) -> None:
    exchange, log = MemoryExchange(), McapLog(tmp_path / "log")
    roomy = replace(SMALL, spool_limit_bytes=4_096_000)
    with MemoryBus(exchange) as bus:
        with VehiclePublisher("veh-a", tmp_path / "spool", bus, roomy) as first:
            drive(first, 500)
        with VehiclePublisher("veh-a", tmp_path / "spool", bus, roomy) as second, ingesting(log, exchange):
            drive(second, 500)
            assert second.flush(SOON_S)
    found = [(one.identity.boot_id, one.identity.sequence) for one in stored(log, "veh-veh-a")]
    log.close()
    assert found == [(boot, number) for boot in (first.boot_id, second.boot_id) for number in range(500)]


def test_a_receiver_that_lost_what_it_acknowledged_gets_the_description_and_all_that_is_left(tmp_path: Path) -> None:
    exchange = MemoryExchange()
    log, emptied = McapLog(tmp_path / "log"), McapLog(tmp_path / "emptied")
    hasty = replace(SMALL, ack_timeout_s=0.05, ack_timeout_max_s=0.1)
    with MemoryBus(exchange) as bus, VehiclePublisher("veh-a", tmp_path / "spool", bus, hasty) as publisher:
        with ingesting(log, exchange):
            drive(publisher, 50)
            assert publisher.flush(SOON_S)
        event = ImuMeasured(yaw_rate_radps=0.0, acceleration_x_mps2=1.0, acceleration_y_mps2=0.0)
        last = publisher.send(event, stamp_ns=START_NS + 50 * STEP_NS)
        with ingesting(emptied, exchange):
            assert publisher.flush(SOON_S)
    found = [one.identity.sequence for one in stored(emptied, "veh-veh-a")]
    refused = stored(emptied, "refused")
    log.close()
    emptied.close()
    assert found == [0, last.sequence]
    assert len(refused) == 49
