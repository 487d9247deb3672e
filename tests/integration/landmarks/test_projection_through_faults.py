"""The projection as a process, with a real server: whatever happens, the database is what the log says."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from landmark_databases.cluster import Cluster, running_cluster
from landmark_databases.faults import Trial, differences_after, killed
from landmark_maps.histories import History

pytestmark = [pytest.mark.postgis, pytest.mark.slow]

TRIAL = Trial(
    history=History(landmark_count=400, changed_count=100, event_count=15_000), batch_events=300, times=3, seed=1
)


@pytest.fixture
def durable(postgis: Cluster) -> Iterator[Cluster]:
    """A server that waits for the disk: what it committed it has after a failure of its power."""
    with running_cluster(durable=True) as cluster:
        yield cluster


def test_a_server_restarted_in_mid_projection_loses_and_doubles_nothing(durable: Cluster, tmp_path: Path) -> None:
    found = differences_after(lambda _: durable.restart("immediate"), TRIAL, data=tmp_path, cluster=durable)
    assert found == (TRIAL.times, ())


def test_a_projection_killed_in_mid_projection_loses_and_doubles_nothing(postgis: Cluster, tmp_path: Path) -> None:
    found = differences_after(killed, TRIAL, data=tmp_path, cluster=postgis)
    assert found == (TRIAL.times, ())
