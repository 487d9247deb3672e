"""A project opened by QGIS itself, in a process of the system's Python, without a screen."""

import json
import os
import subprocess
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

SYSTEM_PYTHON = "/usr/bin/python3"
LOOKING = Path(__file__).with_name("looking.py")
LIMIT_S = 120.0

Box = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class SeenProject:
    """What QGIS says of a project."""

    title: str
    crs: str
    layers: dict[str, dict[str, Any]]
    errors: list[str]

    def points_m(self, layer: str) -> dict[str, tuple[float, float]]:
        """Where the features of a layer are on the project's grid; those without a place left out."""
        points = self.layers[layer]["points_m"]
        return {name: (point[0], point[1]) for name, point in points.items() if point is not None}


@lru_cache(maxsize=1)
def is_installed() -> bool:
    """Whether the system's Python has QGIS (Debian's python3-qgis)."""
    if not Path(SYSTEM_PYTHON).is_file():
        return False
    asked = subprocess.run(
        [SYSTEM_PYTHON, "-c", "import qgis.core"], capture_output=True, check=False, env=_environment()
    )
    return asked.returncode == 0


def seen(project: Path, picture: Path, box_m: Box) -> SeenProject:
    """The project as QGIS opens it, and a picture of a box of its grid."""
    said = json.loads(ran_in_qgis(LOOKING, str(project), str(picture), ",".join(map(str, box_m))))
    assert said["read"], f"{project} is no project"
    return SeenProject(said["title"], said["crs"], said["layers"], said["errors"])


def ran_in_qgis(script: Path, *words: str) -> str:
    """What a script said on standard output, run by the system's Python. Raises AssertionError where it failed."""
    command = [SYSTEM_PYTHON, str(script), *words]
    finished = subprocess.run(command, capture_output=True, text=True, check=False, env=_environment(), timeout=LIMIT_S)
    assert finished.returncode == 0, finished.stderr
    return finished.stdout


def _environment() -> dict[str, str]:
    own = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))}
    return {**own, "QT_QPA_PLATFORM": "offscreen", "NO_PROXY": "127.0.0.1"}
