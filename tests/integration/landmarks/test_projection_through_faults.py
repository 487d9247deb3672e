"""The projection as a process, with a real server: whatever happens, the database is what the log says."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from landmark_databases.cluster import Cluster, running_cluster
from landmark_databases.faults import Trial, differences_after, killed
from landmark_maps.histories import History

pytestmark = pytest.mark.postgis

# Many small transactions, so that there is time to strike between the first and the last.
SHORT = Trial(
    history=History(landmark_count=100, changed_count=25, event_count=2_500), batch_events=25, times=1, seed=1
)
LONG = Trial(
    history=History(landmark_count=400, changed_count=100, event_count=30_000), batch_events=150, times=5, seed=1
)
trials = pytest.mark.parametrize("trial", [SHORT, pytest.param(LONG, marks=pytest.mark.slow)], ids=["short", "long"])


@pytest.fixture
def durable(postgis: Cluster) -> Iterator[Cluster]:
    """A server that waits for the disk: what it committed it has after a failure of its power."""
    with running_cluster(durable=True) as cluster:
        yield cluster


@trials
def test_a_server_restarted_in_mid_projection_loses_and_doubles_nothing(
    durable: Cluster, trial: Trial, tmp_path: Path
) -> None:
    found = differences_after(lambda _: durable.restart("immediate"), trial, data=tmp_path, cluster=durable)
    assert found == (trial.times, ())


@trials
def test_a_projection_killed_in_mid_projection_loses_and_doubles_nothing(
    postgis: Cluster, trial: Trial, tmp_path: Path
) -> None:
    found = differences_after(killed, trial, data=tmp_path, cluster=postgis)
    assert found == (trial.times, ())
