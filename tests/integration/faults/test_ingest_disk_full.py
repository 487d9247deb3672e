"""A full disk: nothing is acknowledged while it lasts, nothing acknowledged is lost, and it goes on by itself."""

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from event_examples.rows import START_NS, imu_rows
from ingest_load.full_disk import SmallDisk, small_disk
from trigpoint.bus.event_messages import event_message
from trigpoint.bus.memory_bus import MemoryBus
from trigpoint.bus.ports import Subscription
from trigpoint.events.codec import Event
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import VehicleDescribed
from trigpoint.events.uplink import acknowledgement_key, uplink_key
from trigpoint.logs.mcap_log import McapLog
from trigpoint.observability.metrics import Instruments
from trigpoint_ingest.app import IngestService
from trigpoint_ingest.settings import IngestSettings

SOON_S = 30.0
SETTINGS = IngestSettings(batch_s=0.0, disk_retry_s=0.05, claim_settle_s=0.0)
DESCRIBED = VehicleDescribed(
    vehicle="van", declared_crs="EPSG:32756", declared_origin_easting_m=332_000.0, declared_origin_northing_m=6.249e6
)
ROWS: list[Envelope[Event]] = [Envelope(EventIdentity("van", "boot-1", 0), START_NS, DESCRIBED), *imu_rows(1, 3000)]


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[SmallDisk]:
    """Eight MiB that can be filled."""
    try:
        with small_disk(tmp_path / "disk", size_bytes=8 * 1024 * 1024) as found:
            yield found
    except PermissionError as error:
        pytest.skip(f"mounting a file system is not allowed here: {error}")


class Ingest:
    """Ingest at work on a disk, and what its vehicle hears."""

    def __init__(self, disk: SmallDisk) -> None:
        self.instruments = Instruments("ingest")
        self.log = McapLog(disk.folder / "log")
        self.bus = MemoryBus()
        self._heard: Subscription = self.bus.subscribe(acknowledgement_key("van"))
        self.service = IngestService(self.log, self.bus, SETTINGS, instruments=self.instruments)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self.service.run, args=(self._stop,))
        self.acknowledged = -1

    def send(self, rows: list[Envelope[Event]]) -> None:
        """The vehicle's messages sent."""
        for row in rows:
            self.bus.publish(event_message(row, key=uplink_key("van", type(row.event))))

    def is_acknowledged(self, sequence: int) -> bool:
        """Whether the vehicle heard that everything up to this is kept."""
        while (message := self._heard.receive(0.0)) is not None:
            self.acknowledged = message.identity.sequence
        return self.acknowledged >= sequence

    def is_blocked(self) -> bool:
        """Whether it says that the log cannot be written."""
        return self.instruments.registry.get_sample_value("trigpoint_append_blocked") == 1.0

    def __enter__(self) -> "Ingest":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        self.service.close()
        self.log.close()


def until(holds: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + SOON_S
    while not holds() and time.monotonic() < deadline_s:
        time.sleep(0.01)


def test_a_full_disk_stops_acknowledgements_loses_nothing_and_resumes_by_itself(
    disk: SmallDisk, caplog: pytest.LogCaptureFixture
) -> None:
    with Ingest(disk) as ingest:
        ingest.send(ROWS[:1000])
        until(lambda: ingest.is_acknowledged(999))
        disk.fill()
        ingest.send(ROWS[1000:])
        until(ingest.is_blocked)
        assert ingest.is_blocked()
        assert not ingest.is_acknowledged(1000)
        disk.free()
        until(lambda: ingest.is_acknowledged(2999))
        assert (ingest.acknowledged, ingest.is_blocked()) == (2999, False)
    assert [row.envelope for row in McapLog(disk.folder / "log").read("veh-van")] == ROWS
    assert caplog.text.count("nothing is acknowledged until the log can be written") == 1
