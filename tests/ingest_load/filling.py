"""Ingest whose disk is full for a while, as vehicles publish all along."""

import threading
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from command_runs.processes import Fleet, wait_until
from ingest_load.full_disk import small_disk
from ingest_load.kept import Kept, kept_of
from ingest_load.racing import ingest_at_work
from trigpoint.bus.zenoh_bus import ZenohSettings
from trigpoint.events.observed import ImuMeasured, VehicleDescribed
from trigpoint_vehicle.publisher import VehiclePublisher

DISK_BYTES = 48 * 1024 * 1024
SETTLING_S = 2.0  # until what was under way when the disk filled up is acknowledged or held back
INTERVAL_S = 0.02
DRAINED_WITHIN_S = 120.0
T0_NS = 1_700_000_000_000_000_000
STEP_NS = 20_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Filled:
    """Messages acknowledged while the disk was full, those that waited with the vehicles when it was freed, whether
    all were acknowledged in the end, and what the log holds."""

    acknowledged_while_full: int
    waiting_when_freed: int
    all_acknowledged: bool
    kept: Kept


class Driving(threading.Thread):
    """Vehicles that describe themselves and send an inertial sample each interval until they are stopped."""

    def __init__(self, publishers: list[VehiclePublisher]) -> None:
        super().__init__(name="driving", daemon=True)
        self._publishers = publishers
        self._stop_driving = threading.Event()
        self.sent = 1

    def run(self) -> None:
        """Each vehicle's messages sent."""
        for publisher in self._publishers:
            described = VehicleDescribed(
                vehicle=publisher.vehicle,
                declared_crs="EPSG:32756",
                declared_origin_easting_m=332_000.0,
                declared_origin_northing_m=6_249_000.0,
            )
            publisher.describe(described, stamp_ns=T0_NS)
        while not self._stop_driving.wait(INTERVAL_S):
            sample = ImuMeasured(yaw_rate_radps=0.1, acceleration_x_mps2=0.1, acceleration_y_mps2=0.2)
            for publisher in self._publishers:
                publisher.send(sample, stamp_ns=T0_NS + self.sent * STEP_NS)
            self.sent += 1

    def stop(self) -> None:
        """No more is sent."""
        self._stop_driving.set()
        self.join()


def filled_up(folder: Path, *, full_s: float, vehicles: int = 10) -> Filled:
    """What came of a disk that was full for so long. Raises PermissionError where mounting is not allowed."""
    folder.mkdir(parents=True)
    pause = threading.Event()
    with ExitStack() as stack:
        disk = stack.enter_context(small_disk(folder / "disk", size_bytes=DISK_BYTES))
        fleet = stack.enter_context(ingest_at_work(folder, data=disk.folder))
        publishers = [stack.enter_context(_publisher(fleet, folder, f"veh-{number}")) for number in range(vehicles)]
        driving = Driving(publishers)
        driving.start()
        wait_until(lambda: all(one.sent.acknowledged > 10 for one in publishers), "first acknowledgements")
        disk.fill()
        pause.wait(SETTLING_S)
        before = _acknowledged(publishers)
        pause.wait(full_s)
        meanwhile = _acknowledged(publishers) - before
        waiting = sum(publisher.behind.messages for publisher in publishers)
        disk.free()
        driving.stop()
        drained = all(publisher.flush(DRAINED_WITHIN_S) for publisher in publishers)
        sent = {publisher.vehicle: (publisher.boot_id, driving.sent) for publisher in publishers}
        kept = kept_of(fleet.data / "log", sent)
    return Filled(acknowledged_while_full=meanwhile, waiting_when_freed=waiting, all_acknowledged=drained, kept=kept)


def _publisher(fleet: Fleet, folder: Path, vehicle: str) -> VehiclePublisher:
    bus = ZenohSettings(connect=(fleet.endpoint,), mode="client")
    return VehiclePublisher(vehicle, folder / "spools" / vehicle, bus)


def _acknowledged(publishers: list[VehiclePublisher]) -> int:
    return sum(publisher.sent.acknowledged for publisher in publishers)
