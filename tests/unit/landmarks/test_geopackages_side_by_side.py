"""GeoPackages made by several threads of one process, as a replay of several logs does."""

import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import geoalchemy2  # noqa: F401 - its hooks on tables are what threads get into each other's way by
import pytest

from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint.landmarks.model import MapVersion

THREADS, FILES = 8, 8


@pytest.fixture
def hasty_threads() -> Iterator[None]:
    """Threads take turns far more often than usual."""
    usual_s = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(usual_s)


@pytest.mark.usefixtures("hasty_threads")
def test_threads_make_geopackages_side_by_side(tmp_path: Path) -> None:
    def newest_of_fresh(number: int) -> MapVersion | None:
        with closing(GeoPackageStore(tmp_path / f"{number}.gpkg")) as store:
            return store.newest_version()

    with ThreadPoolExecutor(THREADS) as threads:
        assert list(threads.map(newest_of_fresh, range(FILES))) == [None] * FILES
    with closing(GeoPackageStore(tmp_path / "0.gpkg")) as again:
        assert again.newest_version() is None
