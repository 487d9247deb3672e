"""A vehicle's publisher numbers, spools, sends and sends again, and forgets only what is acknowledged."""

import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

from trigpoint.bus.memory_bus import MemoryBus, MemoryExchange
from trigpoint.bus.ports import BusMessage, Subscription
from trigpoint.errors import AppendFailed, EventRejected, InputError, ServiceError
from trigpoint.events.envelope import EventIdentity
from trigpoint.events.mapped import MapSolved
from trigpoint.events.observed import ImuMeasured, VehicleDescribed
from trigpoint.events.uplink import acknowledgement_key, uplink_expression
from trigpoint.logs.vehicle_log import RawMessage
from trigpoint_vehicle.publisher import VehiclePublisher
from trigpoint_vehicle.settings import VehicleSettings

IMU = ImuMeasured(yaw_rate_radps=0.1, acceleration_x_mps2=0.0, acceleration_y_mps2=9.0)
DESCRIBED = VehicleDescribed(vehicle="veh-a", wheelbase_m=2.8)
QUICK = VehicleSettings(ack_timeout_s=0.05, ack_timeout_max_s=0.1)
SOON_S = 20.0  # what takes milliseconds here
ONCE = replace(QUICK, ack_timeout_s=SOON_S, ack_timeout_max_s=SOON_S)  # nothing is sent again for lack of time


class Receiver:
    """Hears what vehicles send, and acknowledges what it is told to."""

    def __init__(self, bus: MemoryBus) -> None:
        self._bus = bus
        self._subscription: Subscription = bus.subscribe(uplink_expression())

    def heard(self, count: int) -> list[BusMessage]:
        """The next messages, exactly so many."""
        messages = [self._subscription.receive(SOON_S) for _ in range(count)]
        return [message for message in messages if message is not None]

    def hears_nothing(self, within_s: float = 0.3) -> bool:
        return self._subscription.receive(within_s) is None

    def acknowledge(self, identity: EventIdentity) -> None:
        key = acknowledgement_key("veh-a")
        self._bus.publish(BusMessage(key=key, schema_name="ack", payload=b"", identity=identity, stamp_ns=0))


@pytest.fixture
def exchange() -> MemoryExchange:
    return MemoryExchange()


@pytest.fixture
def receiver(exchange: MemoryExchange) -> Iterator[Receiver]:
    with MemoryBus(exchange) as bus:
        yield Receiver(bus)


Opening = Callable[..., VehiclePublisher]


@pytest.fixture
def opened(exchange: MemoryExchange, tmp_path: Path) -> Iterator[Opening]:
    """Opens the vehicle's publisher, on a session of its own each time."""
    publishers: list[VehiclePublisher] = []
    buses: list[MemoryBus] = []

    def opening(settings: VehicleSettings = QUICK, *, vehicle: str = "veh-a") -> VehiclePublisher:
        buses.append(MemoryBus(exchange))
        publishers.append(VehiclePublisher(vehicle, tmp_path / "spool", buses[-1], settings))
        return publishers[-1]

    yield opening
    for publisher in publishers:
        publisher.close()
    for bus in buses:
        bus.close()


def fill(publisher: VehiclePublisher) -> None:
    """Sends until it is refused."""
    while True:
        publisher.send(IMU, stamp_ns=6)


def sequences(messages: list[BusMessage]) -> list[int]:
    return [message.identity.sequence for message in messages]


def test_events_are_numbered_from_the_description_on_and_sent_on_their_keys(
    opened: Opening, receiver: Receiver
) -> None:
    publisher = opened(ONCE)
    identities = [publisher.describe(DESCRIBED, stamp_ns=5), publisher.send(IMU, stamp_ns=6)]
    described, measured = receiver.heard(2)
    assert identities == [described.identity, measured.identity]
    assert [described.identity.sequence, measured.identity.sequence] == [0, 1]
    assert [described.key, measured.key] == ["trigpoint/v1/veh/veh-a/up/description", "trigpoint/v1/veh/veh-a/up/imu"]
    assert (measured.stamp_ns, measured.identity.boot_id) == (6, publisher.boot_id)


def test_what_is_not_acknowledged_is_sent_again_until_it_is(opened: Opening, receiver: Receiver) -> None:
    publisher = opened()
    publisher.describe(DESCRIBED, stamp_ns=5)
    last = publisher.send(IMU, stamp_ns=6)
    receiver.heard(4)
    receiver.acknowledge(last)
    assert publisher.flush(SOON_S)
    assert publisher.sent.resent >= 2
    assert publisher.sent.acknowledged == 2


def test_what_is_acknowledged_is_not_sent_again(opened: Opening, receiver: Receiver) -> None:
    publisher = opened()
    first = publisher.describe(DESCRIBED, stamp_ns=5)
    receiver.acknowledge(receiver.heard(1)[0].identity)
    assert publisher.flush(SOON_S)
    while not receiver.hears_nothing():
        pass
    publisher.send(IMU, stamp_ns=6)
    assert first.sequence not in sequences(receiver.heard(3))


def test_flush_tells_when_not_everything_is_acknowledged(opened: Opening, receiver: Receiver) -> None:
    publisher = opened()
    publisher.describe(DESCRIBED, stamp_ns=5)
    receiver.heard(1)
    assert not publisher.flush(0.05)
    assert publisher.behind.messages == 1
    assert publisher.behind.bytes > 0
    assert publisher.behind.oldest_s > 0.0


def test_a_restart_sends_the_old_boot_s_rest_first_then_its_own(opened: Opening, receiver: Receiver) -> None:
    first = opened()
    first.describe(DESCRIBED, stamp_ns=5)
    first.send(IMU, stamp_ns=6)
    receiver.heard(2)
    first.close()
    while not receiver.hears_nothing():
        pass
    second = opened(ONCE)
    second.describe(DESCRIBED, stamp_ns=7)
    heard = receiver.heard(3)
    assert [message.identity.boot_id for message in heard] == [first.boot_id, first.boot_id, second.boot_id]
    assert sequences(heard) == [0, 1, 0]
    assert first.boot_id != second.boot_id


def test_messages_wait_for_somebody_to_listen(opened: Opening, exchange: MemoryExchange) -> None:
    publisher = opened(ONCE)
    publisher.describe(DESCRIBED, stamp_ns=5)
    assert not publisher.flush(0.2)
    with MemoryBus(exchange) as bus:
        receiver = Receiver(bus)
        (late,) = receiver.heard(1)
        receiver.acknowledge(late.identity)
        assert publisher.flush(SOON_S)


def test_at_most_a_window_is_under_way(opened: Opening, receiver: Receiver) -> None:
    window = replace(ONCE, window_count=5)
    publisher = opened(window)
    publisher.describe(DESCRIBED, stamp_ns=5)
    last = [publisher.send(IMU, stamp_ns=6) for _ in range(9)][-1]
    heard = receiver.heard(5)
    assert receiver.hears_nothing()
    receiver.acknowledge(heard[4].identity)
    assert receiver.heard(5)[-1].identity == last


def test_threads_send_at_once_and_every_number_is_given_once(opened: Opening) -> None:
    publisher = opened()
    publisher.describe(DESCRIBED, stamp_ns=5)
    with ThreadPoolExecutor(max_workers=4) as pool:
        given = list(pool.map(lambda stamp_ns: publisher.send(IMU, stamp_ns=stamp_ns).sequence, range(400)))
    assert sorted(given) == list(range(1, 401))


def test_an_acknowledgement_of_another_vehicle_or_boot_is_none(opened: Opening, receiver: Receiver) -> None:
    publisher = opened()
    publisher.describe(DESCRIBED, stamp_ns=5)
    (heard,) = receiver.heard(1)
    receiver.acknowledge(replace(heard.identity, source="veh-b"))
    receiver.acknowledge(replace(heard.identity, boot_id="another"))
    assert not publisher.flush(0.2)


def test_a_recorded_message_keeps_the_identity_it_has(opened: Opening, receiver: Receiver) -> None:
    publisher = opened()
    identity = EventIdentity("veh-a", "recorded", 17)
    publisher.forward(RawMessage("topic", "no.such.Schema", b"bytes", identity, 5))
    (heard,) = receiver.heard(1)
    assert (heard.identity, heard.payload, heard.schema_name) == (identity, b"bytes", "no.such.Schema")
    assert heard.key == "trigpoint/v1/veh/veh-a/up/unknown"


def test_a_recorded_message_of_another_vehicle_is_refused(opened: Opening) -> None:
    with pytest.raises(InputError, match="not of vehicle 'veh-a'"):
        opened().forward(RawMessage("topic", "schema", b"", EventIdentity("veh-b", "boot", 0), 5))


def test_before_the_description_nothing_is_sent(opened: Opening) -> None:
    with pytest.raises(InputError, match="has not described itself"):
        opened().send(IMU, stamp_ns=5)


def test_another_vehicle_is_not_described(opened: Opening) -> None:
    with pytest.raises(InputError, match="'veh-a' cannot describe 'veh-b'"):
        opened().describe(VehicleDescribed(vehicle="veh-b"), stamp_ns=5)


def test_what_no_vehicle_sends_is_refused(opened: Opening) -> None:
    publisher = opened()
    publisher.describe(DESCRIBED, stamp_ns=5)
    solved = MapSolved(
        map_version=1, method="", settings_json="", inputs=(), landmark_count=0, anchor_count=0, wall_s=0.0
    )
    with pytest.raises(InputError, match="MapSolved is not what a vehicle sends"):
        publisher.send(solved, stamp_ns=5)  # type: ignore[arg-type]  # that is the point


def test_a_payload_over_the_limit_is_refused_with_both_sizes(opened: Opening) -> None:
    publisher = opened(replace(QUICK, message_limit_bytes=10))
    with pytest.raises(EventRejected, match=r"payload of \d+ bytes, limit 10"):
        publisher.describe(DESCRIBED, stamp_ns=5)


def test_a_refused_event_uses_up_no_number(opened: Opening) -> None:
    publisher = opened()
    publisher.describe(DESCRIBED, stamp_ns=5)
    with pytest.raises(InputError):
        publisher.send(IMU, stamp_ns=2**63)
    assert publisher.send(IMU, stamp_ns=6).sequence == 1


def test_a_full_spool_refuses_and_goes_on_once_something_is_acknowledged(opened: Opening, receiver: Receiver) -> None:
    publisher = opened(replace(ONCE, segment_bytes=1024, spool_limit_bytes=8192))
    publisher.describe(DESCRIBED, stamp_ns=5)
    with pytest.raises(AppendFailed, match="limit 8192"):
        fill(publisher)
    last = receiver.heard(publisher.behind.messages)[-1].identity
    receiver.acknowledge(last)
    assert publisher.flush(SOON_S)
    assert publisher.send(IMU, stamp_ns=7).sequence == last.sequence + 1


def test_after_close_nothing_is_taken(opened: Opening) -> None:
    publisher = opened()
    publisher.close()
    publisher.close()
    with pytest.raises(ServiceError, match="is closed"):
        publisher.describe(DESCRIBED, stamp_ns=5)


def test_a_closed_bus_loses_nothing(exchange: MemoryExchange, tmp_path: Path, receiver: Receiver) -> None:
    with MemoryBus(exchange) as bus:
        publisher = VehiclePublisher("veh-a", tmp_path, bus, QUICK)
    identity = publisher.describe(DESCRIBED, stamp_ns=5)
    assert not publisher.flush(0.1)
    publisher.close()
    with MemoryBus(exchange) as bus, VehiclePublisher("veh-a", tmp_path, bus, QUICK):
        assert receiver.heard(1)[0].identity == identity


@pytest.mark.parametrize("name", ["", "veh/a", "veh*"])
def test_a_name_no_vehicle_can_have_is_refused(name: str, tmp_path: Path) -> None:
    with MemoryBus() as bus, pytest.raises(InputError, match="name"):
        VehiclePublisher(name, tmp_path, bus)


def test_closing_ends_the_thread(opened: Opening) -> None:
    opened().close()
    assert [thread.name for thread in threading.enumerate() if thread.name.startswith("publisher")] == []


def test_a_program_that_does_not_close_its_publisher_ends_all_the_same(tmp_path: Path) -> None:
    code = (
        "import pathlib, sys\n"
        "from trigpoint.bus.zenoh_bus import ZenohSettings\n"
        "from trigpoint.events.observed import VehicleDescribed\n"
        "from trigpoint_vehicle.publisher import VehiclePublisher\n"
        "publisher = VehiclePublisher('veh-a', pathlib.Path(sys.argv[1]), ZenohSettings())\n"
        "publisher.describe(VehicleDescribed(vehicle='veh-a'), stamp_ns=1)\n"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=True, timeout=60.0)
    with MemoryBus() as bus, VehiclePublisher("veh-a", tmp_path, bus) as again:
        assert again.behind.messages == 1


def test_importing_the_publisher_loads_no_library_of_the_servers() -> None:
    code = (
        "import sys, trigpoint_vehicle.publisher\n"
        "print(sorted({'gtsam', 'sqlalchemy', 'geoalchemy2', 'psycopg', 'pyproj', 'filterpy', 'scipy', 'mcap',"
        " 'matplotlib', 'pyogrio', 'pydantic', 'click'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"spool_limit_bytes": 100}, "spool_limit_bytes 100: at least 8 times segment_bytes"),
        ({"window_count": 0}, "window_count 0: more than 0"),
        ({"ack_timeout_s": 20.0}, "ack_timeout_max_s 10: at least ack_timeout_s, 20"),
        ({"sync_interval_s": float("nan")}, "sync_interval_s nan"),
    ],
)
def test_settings_outside_the_limits_are_refused_with_them(change: dict[str, float], told: str) -> None:
    with pytest.raises(InputError, match=told):
        VehicleSettings(**change)  # type: ignore[arg-type]  # floats where they are
