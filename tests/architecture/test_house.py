"""Rules of the house that no linter holds."""

import ast
import tomllib
from pathlib import Path
from typing import Any

import pytest

REPOSITORY = Path(__file__).parents[2]
SOURCES = sorted(
    path
    for folder in ("services", "shared", "schemas")
    for path in (REPOSITORY / folder).rglob("*.py")
    if not path.name.endswith("_pb2.py")
)
SERVICES = sorted(path.parent for path in (REPOSITORY / "services").glob("*/__init__.py"))
FILE_LINES = 400
FUNCTION_LINES = 30
EMPTY_WORDS = {"utils", "util", "helpers", "helper", "common", "misc", "manager", "base"}


def named(path: Path) -> str:
    return path.relative_to(REPOSITORY).as_posix()


def configuration() -> dict[str, Any]:
    return tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))


def functions(path: Path) -> list[ast.FunctionDef | ast.AsyncFunctionDef]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]


def body_lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of a function's body, its docstring not counted."""
    body = function.body[1:] if ast.get_docstring(function, clean=False) is not None else function.body
    return (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 0


@pytest.mark.parametrize("path", [path for path in SOURCES if path.name == "__init__.py"], ids=named)
def test_a_package_file_holds_a_docstring_and_nothing_else(path: Path) -> None:
    (only,) = ast.parse(path.read_text(encoding="utf-8")).body
    assert isinstance(only, ast.Expr)
    assert isinstance(only.value, ast.Constant)


def test_no_file_is_longer_than_one_idea() -> None:
    lengths = {named(path): len(path.read_text(encoding="utf-8").splitlines()) for path in SOURCES}
    assert {name: length for name, length in lengths.items() if length > FILE_LINES} == {}


def test_no_function_is_longer_than_a_screen() -> None:
    lengths = {f"{named(path)}:{one.name}": body_lines(one) for path in SOURCES for one in functions(path)}
    assert {name: length for name, length in lengths.items() if length > FUNCTION_LINES} == {}


def test_no_file_has_a_name_that_says_nothing() -> None:
    assert [named(path) for path in SOURCES if EMPTY_WORDS & set(path.stem.split("_"))] == []


def test_every_folder_with_code_is_a_package() -> None:
    folders = {path.parent for path in SOURCES}
    assert [named(folder) for folder in sorted(folders) if not (folder / "__init__.py").exists()] == []


def test_import_contracts_know_every_package() -> None:
    tops = {
        path.parent.name
        for folder in ("services", "shared", "schemas")
        for path in (REPOSITORY / folder).glob("*/__init__.py")
    }
    assert set(configuration()["tool"]["importlinter"]["root_packages"]) == tops


def test_every_service_is_held_independent_except_the_one_that_composes() -> None:
    contracts = configuration()["tool"]["importlinter"]["contracts"]
    (independence,) = [contract for contract in contracts if contract["type"] == "independence"]
    assert {*independence["modules"], "trigpoint_cli"} == {service.name for service in SERVICES}


@pytest.mark.parametrize("service", [service for service in SERVICES if service.name != "trigpoint_cli"], ids=named)
def test_a_service_has_the_anatomy_of_all(service: Path) -> None:
    there = {path.name for path in service.iterdir()}
    assert {"__init__.py", "app.py", "settings.py", "core"} - there == set()
