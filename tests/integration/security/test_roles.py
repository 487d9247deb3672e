"""Services with certificates of their own roles work together, and the router refuses none of what they do."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from command_runs.processes import comes_true, trigpoint_process
from scanned_worlds.casting import SIXTEEN, STREET, swept
from secured_fleet.fleet import SecuredFleet, files_of, secured_fleet
from trigpoint.bus.register import Role
from trigpoint.events.observed import GnssFixReceived, ImuMeasured, VehicleDescribed
from trigpoint_vehicle.publisher import VehiclePublisher

SERVICES = ("ingest", "filtering", "perception", "optimisation", "landmarks")
SWEEP_EVERY = 50
STAMP_NS, STEP_NS = 1_700_000_000_000_000_000, 10_000_000
SOON_S = 60.0


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[SecuredFleet]:
    """A router and the services, each under its own role."""
    with secured_fleet(tmp_path / "fleet") as fleet, ExitStack() as stack:
        for service in SERVICES:
            if service != "ingest":  # there already
                fleet.issue(service, Role(service))
            files = files_of(fleet.folder, service)
            own = ("bus.tls.certificate_file", files.certificate_file), ("bus.tls.key_file", files.key_file)
            flags = [word for key, path in own for word in ("--set", f"{key}={path}")]
            stack.enter_context(
                trigpoint_process(fleet.folder, "serve", service, "--config", fleet.fleet.config, *flags)
            )
        fleet.fleet.wait_ready(*SERVICES)
        yield fleet


def drive(fleet: SecuredFleet, *, count: int) -> bool:
    """Whether a vehicle's events were all acknowledged."""
    with VehiclePublisher("veh-a", fleet.folder / "spool", fleet.settings("veh-a")) as publisher:
        publisher.describe(VehicleDescribed(vehicle="veh-a", wheelbase_m=2.8), stamp_ns=STAMP_NS)
        turned = ImuMeasured(yaw_rate_radps=0.01, acceleration_x_mps2=0.0, acceleration_y_mps2=0.0)
        scanned = swept(STREET, SIXTEEN)
        for index in range(1, count):
            if index % SWEEP_EVERY == 0:
                publisher.send(scanned, stamp_ns=STAMP_NS + index * STEP_NS)
                continue
            fix = GnssFixReceived(lat_deg=-33.88 + 1e-7 * index, lon_deg=151.19, height_m=20.0, sigma_m=3.0)
            publisher.send(turned if index % 10 else fix, stamp_ns=STAMP_NS + index * STEP_NS)
        return publisher.flush(SOON_S)


def test_a_drive_goes_through_every_service_and_nothing_of_it_is_refused(fleet: SecuredFleet) -> None:
    with fleet.session("services") as onlooker:
        filtered, perceived = (onlooker.subscribe(f"trigpoint/v1/veh/veh-a/{kind}/*") for kind in ("est", "perc"))
        assert drive(fleet, count=500)
        assert comes_true(lambda: fleet.metric("ingest", "trigpoint_accepted_total") == 500.0)
        assert filtered.receive(SOON_S) is not None  # filtering heard ingest, and was heard
        assert perceived.receive(SOON_S) is not None  # and so was perception
    assert fleet.refusals() == []
    assert fleet.refused() == 0.0
