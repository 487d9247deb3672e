"""Drives rendered by threads and by the workers of a Dask cluster: the same files as by one's own hands."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest

from dask_clusters.cluster import running_workers
from dask_clusters.pieces import opened_after_a_death, opened_log
from scanned_drives.examples import arc, drive_rows, map_rows, pinned, solved_path
from trigpoint.errors import ServiceError
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.ports import RecallingLog
from trigpoint.workers import in_turn, workers
from trigpoint_tiles import drive_plans
from trigpoint_tiles.app import PMTILES, XYZ, Rendered, render_ortho
from trigpoint_tiles.hands import Hands, OpenLog
from trigpoint_tiles.settings import TilesSettings

VEHICLES = ("car", "bus")
POSES = arc(2.0)
SETTINGS = TilesSettings(resolution_m=0.5, zooms=2)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log of two drives."""
    folder = tmp_path_factory.mktemp("drives")
    log = McapLog(folder)
    log.append("map", [pinned()])
    for seed, vehicle in enumerate(VEHICLES):
        log.append(f"veh-{vehicle}", drive_rows(vehicle, POSES, seed=seed))
    log.append("optimisation", map_rows([solved_path(vehicle, POSES) for vehicle in VEHICLES]))
    log.close()
    return folder


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with running_workers(tmp_path_factory.mktemp("cluster"), 2) as address:
        yield address


@pytest.fixture
def small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Several pieces a drive."""
    monkeypatch.setattr(drive_plans, "PIECE_SWEEPS", 7)


def rendered(folder: Path, out: Path, *, address: str, open_log: OpenLog) -> Rendered:
    with opened_log(folder) as log, workers(address, threads=0 if address else 2) as some:
        return render_ortho(log, out, formats=(XYZ, PMTILES), settings=SETTINGS, hands=Hands(some, open_log))


def by_own_hands(folder: Path, out: Path) -> Rendered:
    with opened_log(folder) as log:
        return render_ortho(log, out, formats=(XYZ, PMTILES), settings=SETTINGS)


def contents(out: Path) -> dict[Path, bytes]:
    """What the pictures of a folder are."""
    return {path.relative_to(out): path.read_bytes() for path in (out / XYZ).rglob("*.png")}


@pytest.mark.usefixtures("small_pieces")
def test_threads_render_the_same_files_and_count_the_same_points(folder: Path, tmp_path: Path) -> None:
    own = by_own_hands(folder, tmp_path / "own")
    found = rendered(folder, tmp_path / "threads", address="", open_log=partial(opened_log, folder))
    assert found.grids == own.grids
    assert contents(tmp_path / "threads") == contents(tmp_path / "own")


@pytest.mark.slow  # Dask's processes and numba's code in each of them
@pytest.mark.usefixtures("small_pieces")
def test_a_cluster_one_of_whose_workers_dies_renders_the_same_files(cluster: str, folder: Path, tmp_path: Path) -> None:
    own = by_own_hands(folder, tmp_path / "own")
    dying = partial(opened_after_a_death, folder, tmp_path / "died")
    found = rendered(folder, tmp_path / "cluster", address=cluster, open_log=dying)
    assert (tmp_path / "died").exists()
    assert found.grids == own.grids
    assert contents(tmp_path / "cluster") == contents(tmp_path / "own")


def test_a_piece_that_cannot_be_gathered_costs_no_other_drive(folder: Path, tmp_path: Path) -> None:
    failing = iter([ServiceError("the disk is gone"), None])

    @contextmanager
    def opened() -> Iterator[RecallingLog]:
        if (error := next(failing)) is not None:
            raise error
        with opened_log(folder) as log:
            yield log

    with opened_log(folder) as log:
        with pytest.raises(ServiceError, match="1 of 2 pieces of drives not gathered: the disk is gone"):
            render_ortho(log, tmp_path, formats=(XYZ,), settings=SETTINGS, hands=Hands(in_turn(), opened))
        (again,) = render_ortho(log, tmp_path, formats=(XYZ,), settings=SETTINGS).grids
    assert {name: one.kept_from_before for name, one in again.brought_up.counts.items()} == {"bus/b": 0, "car/b": 20}
