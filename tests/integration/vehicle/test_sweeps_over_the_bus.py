"""Sweeps of a lidar go from a vehicle's publisher over the bus into the log, as large as ingest takes them."""

import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest

from bus_sessions.pairs import free_endpoint
from event_examples.any_event import same_event
from trigpoint.bus.memory_bus import MemoryBus, MemoryExchange
from trigpoint.bus.ports import Bus
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings
from trigpoint.errors import EventRejected
from trigpoint.events.observed import EventRefused, VehicleDescribed
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.mcap_log import McapLog
from trigpoint_ingest.app import IngestService
from trigpoint_ingest.core.sweep_limits import POINTS_LIMIT
from trigpoint_ingest.settings import IngestSettings
from trigpoint_vehicle.publisher import VehiclePublisher
from trigpoint_vehicle.settings import VehicleSettings

SOON_S = 90.0  # the messages take under a second; the rest is a slow machine's share
START_NS = 1_700_000_000_000_000_000
STEP_NS = 100_000_000
HDL_64_POINTS = 120_000


def sweep(count: int) -> PointsScanned:
    """So many points as a lidar measures them: they hardly compress."""
    chance = np.random.default_rng(count)
    return PointsScanned(
        sensor="roof",
        sensor_position_m=np.array([0.0, 0.0, 1.9]),
        sensor_orientation=np.array([0.0, 0.0, 0.0, 1.0]),
        point_m=chance.normal(scale=20.0, size=(count, 3)).astype(np.float32),
        intensity=chance.integers(0, 255, count).astype(np.float32),
        offset_ns=np.linspace(-5e7, 5e7, count).astype(np.int32),
        ring=(np.arange(count) % 64).astype(np.uint16),
    )


@contextmanager
def two_sessions(kind: str) -> Iterator[tuple[Bus, Bus]]:
    """A vehicle's session and ingest's."""
    with ExitStack() as stack:
        if kind == "memory":
            exchange = MemoryExchange()
            buses: list[Bus] = [MemoryBus(exchange), MemoryBus(exchange)]
        else:
            endpoint = free_endpoint()
            listening = ZenohBus(ZenohSettings(listen=(endpoint,)))
            buses = [ZenohBus(ZenohSettings(connect=(endpoint,))), listening]
        for bus in buses:
            stack.enter_context(bus)
        yield buses[0], buses[1]


def taken_in(kind: str, folder: Path, sweeps: list[PointsScanned]) -> tuple[list[object], list[object]]:
    """What of a vehicle's sweeps is in the log, and what was refused, once all is acknowledged."""
    stop, log = threading.Event(), McapLog(folder / "log")
    with two_sessions(kind) as (near, far), IngestService(log, far, IngestSettings(batch_s=0.02)) as service:
        thread = threading.Thread(target=service.run, args=(stop,))
        thread.start()
        try:
            with VehiclePublisher("van", folder / "spool", near, VehicleSettings()) as publisher:
                publisher.describe(VehicleDescribed(vehicle="van"), stamp_ns=START_NS)
                for number, one in enumerate(sweeps):
                    publisher.send(one, stamp_ns=START_NS + number * STEP_NS)
                assert publisher.flush(SOON_S)
        finally:
            stop.set()
            thread.join()
    kept = [row.envelope.event for row in log.read("veh-van", kinds=(PointsScanned,))]
    refused: list[object] = [row.envelope.event for row in log.read("refused")]
    log.close()
    return [*kept], refused


@pytest.mark.parametrize("kind", ["memory", "zenoh"])
def test_sweeps_of_64_lasers_and_the_largest_there_may_be_are_in_the_log_exactly(kind: str, tmp_path: Path) -> None:
    sent = [sweep(HDL_64_POINTS), sweep(POINTS_LIMIT), sweep(HDL_64_POINTS)]
    kept, refused = taken_in(kind, tmp_path, sent)
    assert refused == []
    assert [same_event(one, other) for one, other in zip(kept, sent, strict=True)] == [True] * 3  # type: ignore[arg-type]


def test_a_sweep_of_too_many_points_is_refused_on_record_and_the_next_goes_on(tmp_path: Path) -> None:
    kept, refused = taken_in("memory", tmp_path, [sweep(POINTS_LIMIT + 1), sweep(1000)])
    assert [len(one.point_m) for one in kept if isinstance(one, PointsScanned)] == [1000]
    assert [one.reason for one in refused if isinstance(one, EventRefused)] == ["too many points"]


def test_a_sweep_beyond_the_size_of_a_message_is_refused_before_it_is_spooled(tmp_path: Path) -> None:
    with MemoryBus() as bus, VehiclePublisher("van", tmp_path, bus, VehicleSettings()) as publisher:
        publisher.describe(VehicleDescribed(vehicle="van"), stamp_ns=START_NS)
        with pytest.raises(EventRejected, match="too large: payload of 88.* bytes, limit 8388608"):
            publisher.send(sweep(400_000), stamp_ns=START_NS)
        assert publisher.behind.messages == 1
