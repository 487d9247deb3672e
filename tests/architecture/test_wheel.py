"""The built wheel, alone in an environment of its own, has every package and runs."""

import json
import os
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]
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
    venv.create(folder, with_pip=True)
    pip = (folder / "bin" / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check")
    said_by(*pip, "--constraint", REPOSITORY / "constraints.txt", wheel, folder=folder)
    return folder / "bin"


def test_every_module_of_the_source_folders_is_in_the_wheel(wheel: Path) -> None:
    assert modules_in_sources() - set(zipfile.ZipFile(wheel).namelist()) == set()


def test_nothing_but_packages_and_metadata_is_in_the_wheel(wheel: Path) -> None:
    tops = {name.split("/")[0] for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    packages = {path.name for folder in SOURCE_FOLDERS for path in (REPOSITORY / folder).iterdir() if path.is_dir()}
    assert tops == packages - {"__pycache__"}


def test_the_command_of_the_installed_wheel_says_what_it_can_do(installed: Path) -> None:
    said = said_by(installed / "trigpoint", "--help", folder=installed)
    assert {"demo", "convert", "ingest", "build", "report"} <= set(said.split())


def test_the_installed_wheel_drives_a_simulated_campus(installed: Path, tmp_path: Path) -> None:
    said = said_by(installed / "trigpoint", "log", "info", tmp_path, "--json", folder=tmp_path)
    assert json.loads(said) is not None
