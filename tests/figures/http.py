"""The map over HTTP: how fast beside tipg on the same database; whether GDAL and QGIS read all of it where it is."""

import subprocess
import sys
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

from figures.figure import Bounds, Figure, Measurement, at_least, at_most
from figures.workbench import CommandFailed, Workbench
from http_load.beside import Compared, compared
from http_load.crowded_map import COUNT
from http_load.reading import ReadBack, read_back
from landmark_databases.cluster import binaries
from qgis_reading.project import is_installed
from qgis_reading.provider import ReadByQgis, read_by_qgis

COMPARED = f"http_load.beside.compared()  # {COUNT} landmarks in PostGIS; trigpoint serve http and tipg in turn, by wrk"
READ = "http_load.reading.read_back()  # trigpoint serve http, read by GDAL's OAPIF and MVT drivers"
READ_BY_QGIS = "qgis_reading.provider.read_by_qgis()  # trigpoint serve http, read by QGIS's own OGC API provider"
TESTS = Path(__file__).resolve().parent.parent / "integration" / "http" / "test_definition.py"
FAILED_TESTS = 1  # pytest's exit status where tests failed, and nothing else did


@cache
def loads(folder: Path) -> Compared:
    """Both under load once."""
    if binaries() is None:
        raise CommandFailed("no PostgreSQL with PostGIS is installed")
    try:
        return compared(folder / "http")
    except (OSError, subprocess.SubprocessError, AssertionError) as error:
        raise CommandFailed(f"{COMPARED}: {error}") from error


@cache
def reading(folder: Path) -> ReadBack:
    """The map read back once."""
    return read_back(folder / "reading")


@cache
def qgis_reading(folder: Path) -> ReadByQgis:
    """The map read by QGIS once."""
    if not is_installed():
        raise CommandFailed("python3-qgis is not installed")
    try:
        return read_by_qgis(folder / "qgis")
    except (OSError, subprocess.SubprocessError, AssertionError) as error:
        raise CommandFailed(f"{READ_BY_QGIS}: {error}") from error


def of_loads(bench: Workbench, *, value: Callable[[Compared], float]) -> Measurement:
    """A number of the loads."""
    return Measurement(value=value(loads(bench.folder)), command=COMPARED)


def of_reading(bench: Workbench, *, value: Callable[[ReadBack], float]) -> Measurement:
    """A number of what GDAL read."""
    return Measurement(value=value(reading(bench.folder)), command=READ)


def violations(bench: Workbench) -> Measurement:
    """How many operations did not keep to the definition, with a hundred requests each."""
    command = [sys.executable, "-m", "pytest", "-q", "-m", "slow", "-p", "no:cacheprovider", str(TESTS)]
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    if finished.returncode not in (0, FAILED_TESTS):
        raise CommandFailed(f"pytest -m slow {TESTS.name}: exit status {finished.returncode}")
    failed = sum(line.startswith("FAILED") for line in finished.stdout.splitlines())
    return Measurement(value=float(failed), command=f"pytest -m slow tests/integration/http/{TESTS.name}")


def of_qgis(bench: Workbench, *, value: Callable[[ReadByQgis], float]) -> Measurement:
    """A number of what QGIS read."""
    return Measurement(value=value(qgis_reading(bench.folder)), command=READ_BY_QGIS)


def _load(name: str, unit: str, target: Bounds | None, value: Callable[[Compared], float]) -> Figure:
    return Figure(name=name, unit=unit, target=target, measure=partial(of_loads, value=value))


def _read(name: str, unit: str, target: Bounds | None, value: Callable[[ReadBack], float]) -> Figure:
    return Figure(name=name, unit=unit, target=target, measure=partial(of_reading, value=value))


def _by_qgis(name: str, unit: str, target: Bounds | None, value: Callable[[ReadByQgis], float]) -> Figure:
    return Figure(name=name, unit=unit, target=target, measure=partial(of_qgis, value=value))


TIPG_FIGURES = (
    _load("items of 25 of 200,000 landmarks, over tipg's rate", "1", at_least(5.0), lambda seen: seen.items.ratio),
    _load("items of 25 of 200,000 landmarks", "1/s", None, lambda seen: seen.items.rate_hz),
    _load("items of 25 of 200,000 landmarks, p99", "ms", None, lambda seen: seen.items.p99_ms),
    _load("vector tiles cold, over tipg's rate", "1", at_least(3.0), lambda seen: seen.cold.ratio),
    _load("vector tiles cold", "1/s", None, lambda seen: seen.cold.rate_hz),
    _load("vector tiles warm, over tipg's rate", "1", at_least(12.0), lambda seen: seen.warm.ratio),
    _load("vector tiles warm", "1/s", None, lambda seen: seen.warm.rate_hz),
)
FIGURES = (
    *TIPG_FIGURES,
    _by_qgis("QGIS's own provider, landmarks not read", "1", at_most(0.0), lambda seen: seen.missing),
    _by_qgis("QGIS's own provider, farthest from its place", "mm", at_most(10.0), lambda seen: 1e3 * seen.off_m),
    _read("GDAL's OAPIF driver, landmarks not read", "1", at_most(0.0), lambda seen: seen.missing),
    _read("GDAL's OAPIF driver, farthest from its place", "m", at_most(0.01), lambda seen: seen.off_m),
    _read("GDAL's MVT driver, landmarks not read", "1", at_most(0.0), lambda seen: seen.tile_missing),
    _read("GDAL's MVT driver, farthest, in units of the tile", "1", at_most(1.0), lambda seen: seen.tile_off_units),
    Figure(
        name="operations that violate the definition, 100 requests each",
        unit="1",
        target=at_most(0.0),
        measure=violations,
    ),
)
