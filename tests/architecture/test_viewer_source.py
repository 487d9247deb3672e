"""The viewer's source keeps the rules of its own language, and its pure parts do what they should."""

import subprocess
from pathlib import Path

import pytest

VIEWER = Path(__file__).parents[2] / "services" / "trigpoint_landmarks" / "viewer"
LINES = 400


@pytest.fixture
def viewer_built() -> None:
    if not (VIEWER / "node_modules").is_dir():
        pytest.skip("the viewer's packages are not installed: `make viewer`")


@pytest.mark.parametrize("script", ["check", "test"])
def test_the_source_passes_its_own(script: str, viewer_built: None) -> None:
    finished = subprocess.run(
        ["npm", "run", "--silent", script], cwd=VIEWER, capture_output=True, text=True, check=False
    )
    assert finished.returncode == 0, finished.stdout + finished.stderr


def test_no_module_is_longer_than_one_idea() -> None:
    lengths = {path.name: len(path.read_text(encoding="utf-8").splitlines()) for path in VIEWER.glob("src/**/*.ts")}
    assert len(lengths) > 20
    assert {name: length for name, length in lengths.items() if length > LINES} == {}


def test_data_never_becomes_markup() -> None:
    ways = ("innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "setHTML", "eval(")
    texts = {path.name: path.read_text(encoding="utf-8") for path in VIEWER.glob("src/**/*.ts")}
    assert [name for name, text in texts.items() if any(way in text for way in ways)] == []
