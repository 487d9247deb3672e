"""A publisher with a session of its own opens it anew when nothing is acknowledged for long."""

import threading
from pathlib import Path

from command_runs.processes import free_ports, wait_until
from link_faults.proxy import cuttable_link
from link_faults.rates import acknowledger
from trigpoint.bus.zenoh_bus import ZenohSettings
from trigpoint.events.observed import VehicleDescribed
from trigpoint_vehicle.publisher import VehiclePublisher
from trigpoint_vehicle.settings import VehicleSettings

IMPATIENT = VehicleSettings(ack_timeout_s=0.1, ack_timeout_max_s=0.2, reopen_after_s=0.3)
DESCRIBED = VehicleDescribed(vehicle="veh-a")
SOON_S = 60.0


def test_a_silent_session_is_replaced_and_what_it_was_given_is_sent_again(tmp_path: Path) -> None:
    with (
        acknowledger() as endpoint,
        cuttable_link(int(endpoint.rpartition(":")[2])) as link,
        VehiclePublisher("veh-a", tmp_path, ZenohSettings(connect=(link.endpoint,)), IMPATIENT) as publisher,
    ):
        publisher.describe(DESCRIBED, stamp_ns=1)
        assert publisher.flush(SOON_S)
        sessions = publisher.sent.sessions
        link.cut(closing=False)
        publisher.describe(DESCRIBED, stamp_ns=2)
        wait_until(lambda: publisher.sent.sessions > sessions, "another session")
        link.mend()
        assert publisher.flush(SOON_S)
        assert publisher.sent.acknowledged == 2


def test_a_session_that_is_idle_for_long_stays(tmp_path: Path) -> None:
    pause = threading.Event()
    with (
        acknowledger() as endpoint,
        VehiclePublisher("veh-a", tmp_path, ZenohSettings(connect=(endpoint,)), IMPATIENT) as publisher,
    ):
        publisher.describe(DESCRIBED, stamp_ns=1)
        assert publisher.flush(SOON_S)
        sessions = publisher.sent.sessions
        pause.wait(1.0)  # longer than a silent session is borne
        publisher.describe(DESCRIBED, stamp_ns=2)
        assert publisher.flush(SOON_S)
        assert publisher.sent.sessions == sessions


def test_a_client_without_its_router_spools_and_sends_once_it_is_there(tmp_path: Path) -> None:
    nowhere = ZenohSettings(mode="client", connect=(f"tcp/127.0.0.1:{free_ports(1)[0]}",))
    with VehiclePublisher("veh-a", tmp_path, nowhere, IMPATIENT) as publisher:
        publisher.describe(DESCRIBED, stamp_ns=1)
        assert not publisher.flush(0.3)
        assert (publisher.sent.sessions, publisher.behind.messages) == (0, 1)
    with acknowledger() as endpoint:
        there = ZenohSettings(mode="client", connect=(endpoint,), connect_timeout_s=10.0)
        with VehiclePublisher("veh-a", tmp_path, there, IMPATIENT) as publisher:
            assert publisher.flush(SOON_S)
