"""A map of 100,000 landmarks is exported within the memory a small one takes."""

import os
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from exported_maps.reading import SUFFIXES, read_layer
from landmark_maps.examples import change, checkpoint, frame, solved_landmark
from trigpoint.events.solved_landmarks import in_columns
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint_landmarks.core.rows import landmark_rows

FEW, MANY = 20_000, 100_000  # both more than a page
GROWTH_MIB = 48  # for SQLite's cache of the database, at most 64 MiB; 80,000 landmarks as Python has them take 150
KIB_PER_MIB = 1024

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("large")
    for count in (FEW, MANY):
        points_m = np.random.default_rng(3).uniform(0.0, 9_000.0, (count, 2)).tolist()
        solved = [solved_landmark(f"L{n}", x_m, y_m) for n, (x_m, y_m) in enumerate(points_m)]
        (made / str(count)).mkdir()
        with closing(GeoPackageStore(made / str(count) / "landmarks.gpkg")) as store:
            store.apply(change(1, opened=landmark_rows(in_columns(solved), frame())), checkpoint(1))
    return made


def peak_mib(data: Path, out: Path, form: str) -> float:
    """The most memory that the command held."""
    words = [sys.executable, "-m", "trigpoint_cli", "export", form, "--data", str(data), "--out", str(out), "--json"]
    null = os.open(os.devnull, os.O_RDWR)
    pid = os.posix_spawn(
        sys.executable,
        words,
        dict(os.environ),
        file_actions=[(os.POSIX_SPAWN_DUP2, null, stream) for stream in range(3)],
    )
    os.close(null)
    _, status, usage = os.wait4(pid, 0)
    assert os.waitstatus_to_exitcode(status) == 0
    return usage.ru_maxrss / KIB_PER_MIB


@pytest.mark.parametrize("form", sorted(SUFFIXES))
def test_memory_does_not_grow_with_the_map_and_every_landmark_is_there(folder: Path, tmp_path: Path, form: str) -> None:
    few, many = (tmp_path / f"{count}.{SUFFIXES[form]}" for count in (FEW, MANY))
    growth_mib = -peak_mib(folder / str(FEW), few, form) + peak_mib(folder / str(MANY), many, form)
    assert growth_mib < GROWTH_MIB
    assert len(read_layer(many).geometries) == MANY
