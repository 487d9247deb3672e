"""The built wheel, alone in an environment of its own, has every package and runs."""

import os
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]
MANIFEST = """
[[vehicle]]
name = "car"
file = "car.csv"
fixes = { time = "t_s", lat = "lat", lon = "lon" }
"""
SOURCE_FOLDERS = ("services", "shared", "schemas")

pytestmark = pytest.mark.wheel


def said_by(*command: str | Path, folder: Path) -> str:
    """What a command wrote, run where no source folder can be imported from."""
    clean = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONHOME")}
    finished = subprocess.run([*map(str, command)], cwd=folder, env=clean, capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stderr
    return finished.stdout


def modules_in_sources() -> set[str]:
    """Every Python file of the three source folders, as the wheel should name it."""
    roots = [REPOSITORY / folder for folder in SOURCE_FOLDERS]
    return {path.relative_to(root).as_posix() for root in roots for path in root.rglob("*.py")}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    # No isolation: hatchling is among the test dependencies, and the network is not asked twice.
    said_by(sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder, REPOSITORY, folder=folder)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bin folder of a fresh environment with the wheel and its dependencies, as pinned."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder)
    pip = (sys.executable, "-m", "pip", "--python", folder / "bin" / "python", "--quiet", "--disable-pip-version-check")
    # Not compiled: of all the modules installed the command imports few.
    said_by(
        *pip,
        "install",
        "--no-compile",
        "--constraint",
        REPOSITORY / "constraints.txt",
        f"{wheel}[services]",
        folder=folder,
    )
    return folder / "bin"


def test_every_module_of_the_source_folders_is_in_the_wheel(wheel: Path) -> None:
    assert modules_in_sources() - set(zipfile.ZipFile(wheel).namelist()) == set()


def test_nothing_but_packages_and_metadata_is_in_the_wheel(wheel: Path) -> None:
    tops = {name.split("/")[0] for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    packages = {path.name for folder in SOURCE_FOLDERS for path in (REPOSITORY / folder).iterdir() if path.is_dir()}
    assert tops == packages - {"__pycache__"}


def test_of_the_viewer_the_wheel_has_what_was_built_and_no_more(wheel: Path) -> None:
    folder = REPOSITORY / "services" / "trigpoint_landmarks" / "viewer"
    built = {path.relative_to(folder).as_posix() for path in (folder / "dist").rglob("*") if path.is_file()}
    prefix = "trigpoint_landmarks/viewer/"
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.removeprefix(prefix) for name in names if name.startswith(prefix)} == built


def test_the_command_of_the_installed_wheel_says_what_it_can_do(installed: Path) -> None:
    said = said_by(installed / "trigpoint", "--help", folder=installed)
    assert {"demo", "convert", "ingest", "build", "report"} <= set(said.split())


def test_the_installed_wheel_takes_a_table_into_a_log(installed: Path, tmp_path: Path) -> None:
    (tmp_path / "car.csv").write_text("t_s,lat,lon\n0,-33.889,151.193\n1,-33.888,151.193\n", encoding="utf-8")
    (tmp_path / "manifest.toml").write_text(MANIFEST, encoding="utf-8")
    trigpoint = installed / "trigpoint"
    said_by(trigpoint, "convert", "table", "manifest.toml", "logs", folder=tmp_path)
    said_by(trigpoint, "ingest", "logs/car.mcap", "--data", "data", folder=tmp_path)
    assert "veh-car" in said_by(trigpoint, "log", "info", "data", folder=tmp_path)
