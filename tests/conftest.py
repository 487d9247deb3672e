"""What every test may ask for, and the rule that some tests must not be skipped in continuous integration."""

from collections.abc import Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from landmark_databases.cluster import Cluster

REPOSITORY = Path(__file__).resolve().parent.parent
RECORDED_DRIVES = REPOSITORY.parent / "shared" / "data"

pytest_plugins = ["pytester"]


@pytest.fixture(scope="session")
def recorded_drives() -> Path:
    """The folder of recorded drives beside the repository; ask for it in tests marked `data`."""
    return RECORDED_DRIVES


@pytest.fixture(scope="session")
def viewer_built() -> None:
    """The viewer's page is built; ask for it in tests marked `browser`."""
    from viewed_maps.browser import missing

    if missing():
        pytest.skip(missing())


@pytest.fixture(scope="session")
def postgis() -> Iterator["Cluster"]:
    """A PostgreSQL server with PostGIS, for this run only; ask for it in tests marked `postgis`."""
    from landmark_databases.cluster import binaries, running_cluster

    if binaries() is None:
        pytest.skip("no PostgreSQL with PostGIS is installed")
    with running_cluster(durable=False) as cluster:
        yield cluster


@pytest.fixture
def postgis_url(postgis: "Cluster") -> Iterator[str]:
    """The URL of an empty database of its own; the password is where PostgreSQL's clients look it up."""
    with postgis.password_known():
        yield postgis.url(postgis.created())


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--forbid-skipped",
        action="append",
        default=[],
        metavar="MARK",
        help="a skipped test with this mark, and any file skipped whole, counts as failed; may be given more than once",
    )


def pytest_runtest_setup(item: pytest.Item) -> None:
    if item.get_closest_marker("data") and not RECORDED_DRIVES.is_dir():
        pytest.skip(f"recorded drives are not at {RECORDED_DRIVES}")
    if item.get_closest_marker("qgis"):
        from qgis_reading.project import is_installed

        if not is_installed():
            pytest.skip("python3-qgis is not installed")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    forbidden = [mark for mark in item.config.getoption("--forbid-skipped") if item.get_closest_marker(mark)]
    if report.skipped and forbidden and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"skipped, and a test marked {forbidden[0]} must not be: {report.longrepr}"
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    report = yield
    if report.skipped and collector.config.getoption("--forbid-skipped"):
        report.outcome = "failed"
        report.longrepr = f"skipped whole, its marks unseen: {report.longrepr}"
    return report
