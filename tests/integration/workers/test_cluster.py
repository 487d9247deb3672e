"""Independent pieces of work on a Dask cluster of processes: a worker's death costs only what ends workers."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from command_runs.processes import free_ports
from dask_clusters.cluster import running_workers
from dask_clusters.pieces import deadly, deadly_once, squared
from trigpoint.errors import ServiceError
from trigpoint.workers import Workers, workers

WORKERS = 2


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with running_workers(tmp_path_factory.mktemp("cluster"), WORKERS) as address:
        yield address


@pytest.fixture
def some(cluster: str) -> Iterator[Workers]:
    with workers(cluster) as found:
        yield found


def test_pieces_are_worked_on_in_the_workers_processes(some: Workers) -> None:
    done = list(some.each(squared, range(20)))
    assert sorted((one.item, one.result.value) for one in done if one.result) == [(n, n * n) for n in range(20)]
    assert os.getpid() not in {one.result.pid for one in done if one.result}


def test_a_piece_whose_worker_died_is_done_by_another(some: Workers, tmp_path: Path) -> None:
    items = [(number, tmp_path / "died") for number in range(10)]
    assert [one.error for one in some.each(deadly_once, items)] == [None] * len(items)
    assert (tmp_path / "died").exists()


def test_a_piece_that_ends_every_worker_costs_no_other(some: Workers) -> None:
    done = {one.item: one for one in some.each(deadly, range(-1, 10))}
    assert type(done.pop(-1).error).__name__ == "KilledWorker"
    assert {item: one.result for item, one in done.items()} == {number: number for number in range(10)}


def test_no_scheduler_is_an_error_that_names_where() -> None:
    address = f"tcp://127.0.0.1:{free_ports(1)[0]}"
    with pytest.raises(ServiceError, match=f"no Dask scheduler answers at {address}"), workers(address):
        pass
