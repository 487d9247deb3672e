"""A fleet under load holds what it held before: resident memory and file handles stay flat."""

import os
from pathlib import Path

import pytest

from fleet_runs.driving import small_campus_drives
from fleet_runs.footprint import MIB, Footprint, growth, last_share
from fleet_runs.load import Load, loaded, soaked
from fleet_runs.running import fleet_of
from landmark_databases.cluster import Cluster

SOAK_S = float(os.environ.get("SOAK_S", "1800"))  # of the long one; its last two thirds are held flat
HANDLES = 8  # a rotated file beside its successor, a request beside the endpoint, the pipes to a solving process


def grown(footprints: list[Footprint], share: float) -> tuple[float, float]:
    """MiB and handles more at the end of the last part of the time than at its beginning."""
    found = growth(last_share(footprints, share))
    return found.resident_bytes / MIB, found.handles


def test_router_and_ingest_hold_no_more_after_some_seconds_of_load(tmp_path: Path) -> None:
    fleet = fleet_of(tmp_path, ())
    load = Load(vehicles=4, duration_s=5.0, speed=8.0, interval_s=0.1)
    found = loaded(fleet, small_campus_drives(tmp_path / "campus"), ("router", "ingest"), load)
    assert found.sent > 1000
    held = {name: grown(list(found.footprints[name]), 0.6) for name in ("router", "ingest")}
    assert {name: growth for name, growth in held.items() if growth[0] > 8.0 or growth[1] > HANDLES} == {}


@pytest.mark.slow
@pytest.mark.postgis
def test_every_process_is_flat_in_the_last_two_thirds_of_half_an_hour_of_load(tmp_path: Path, postgis: Cluster) -> None:
    found = soaked(tmp_path, postgis, duration_s=SOAK_S)
    shares = {name: growth(last_share(one, 2 / 3)) for name, one in found.items()}
    assert {name: one for name, one in shares.items() if one.resident_share > 0.05 or one.handles > HANDLES} == {}
