"""A small drive, its vehicle log on disk, and an event log to take it into."""

import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import GnssFixReceived, ImuMeasured, Observed, VehicleDescribed
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.vehicle_log import write_vehicle_log

T0 = 1_700_000_000_000_000_000  # ns
STEP_NS = 10_000_000


def drive(vehicle: str, *, count: int, boot_id: str = "boot-1") -> list[Envelope[Observed]]:
    """A described vehicle, then IMU with a fix every tenth event."""
    events: list[Observed] = [VehicleDescribed(vehicle=vehicle, wheelbase_m=2.8)]
    for index in range(1, count):
        if index % 10 == 0:
            events.append(
                GnssFixReceived(lat_deg=-33.8886 + 1e-7 * index, lon_deg=151.1946, height_m=20.0, sigma_m=3.0)
            )
        else:
            events.append(
                ImuMeasured(yaw_rate_radps=0.001 * index, acceleration_x_mps2=0.0, acceleration_y_mps2=math.pi)
            )
    return [
        Envelope(EventIdentity(vehicle, boot_id, sequence), T0 + sequence * STEP_NS, event)
        for sequence, event in enumerate(events)
    ]


@pytest.fixture
def rows() -> list[Envelope[Observed]]:
    """Half a minute of vehicle veh-a, 3,000 events."""
    return drive("veh-a", count=3000)


@pytest.fixture
def vehicle_log(tmp_path: Path, rows: list[Envelope[Observed]]) -> Path:
    """The drive as its vehicle recorded it."""
    path = tmp_path / "veh-a.mcap"
    write_vehicle_log(path, rows, vehicle="veh-a")
    return path


@pytest.fixture
def long_rows() -> list[Envelope[Observed]]:
    """9,000 events: three chunks of a vehicle log."""
    return drive("veh-a", count=9000)


@pytest.fixture
def long_log(tmp_path: Path, long_rows: list[Envelope[Observed]]) -> Path:
    """A vehicle log of three chunks."""
    path = tmp_path / "long.mcap"
    write_vehicle_log(path, long_rows, vehicle="veh-a")
    return path


@pytest.fixture
def log(tmp_path: Path) -> Iterator[McapLog]:
    """An empty event log on disk."""
    opened = McapLog(tmp_path / "log")
    yield opened
    opened.close()
