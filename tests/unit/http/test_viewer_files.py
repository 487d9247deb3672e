"""The viewer's files: who gets them, for how long they may be kept, and what a page may do."""

import asyncio
from pathlib import Path

import pytest

from map_http.asking import asked_api, issued
from trigpoint.landmarks.geopackage_features import GeoPackageFeatures
from trigpoint_landmarks.http.problems import Problem
from trigpoint_landmarks.http.settings import WebSettings
from trigpoint_landmarks.http.viewer_files import ViewerFiles, viewer_files


@pytest.fixture
def files(tmp_path: Path) -> ViewerFiles:
    (tmp_path / "assets").mkdir()
    (tmp_path / "index.html").write_text("<!doctype html>", encoding="utf-8")
    (tmp_path / "assets" / "index-1a2b3c.js").write_text("0", encoding="utf-8")
    return viewer_files(tmp_path)


def test_the_page_is_asked_for_anew_each_time(files: ViewerFiles) -> None:
    answer = files.answer("/")
    assert answer.headers["cache-control"] == "no-cache"
    assert answer.headers["content-type"] == "text/html; charset=utf-8"


def test_what_is_named_by_its_content_is_kept_for_ever(files: ViewerFiles) -> None:
    answer = files.answer("/assets/index-1a2b3c.js")
    assert answer.headers["cache-control"] == "public, max-age=31536000, immutable"
    assert answer.headers["content-type"].startswith("text/javascript")


def test_a_page_may_fetch_from_its_own_service_only(files: ViewerFiles) -> None:
    policy = dict(one.split(" ", 1) for one in files.answer("/").headers["content-security-policy"].split("; "))
    assert policy["default-src"] == "'none'"
    assert (policy["connect-src"], policy["script-src"], policy["style-src"]) == ("'self'",) * 3
    assert policy["frame-ancestors"] == "'none'"


def test_the_address_without_a_slash_leads_to_the_one_with_it(files: ViewerFiles) -> None:
    answer = files.answer("")
    assert (answer.status_code, answer.headers["location"]) == (308, "viewer/")


@pytest.mark.parametrize("path", ["/other.js", "/../settings.py", "/assets/../index.html", "//etc/passwd", "/assets"])
def test_a_path_that_is_no_built_file_is_not_found(files: ViewerFiles, path: str) -> None:
    with pytest.raises(Problem, match="has no file"):
        files.answer(path)


def test_a_viewer_that_was_not_built_says_how_to_build_it(tmp_path: Path) -> None:
    with pytest.raises(Problem, match="make viewer") as told:
        viewer_files(tmp_path / "dist").answer("/")
    assert told.value.status == 404


def test_the_page_needs_no_token_where_the_map_does(tmp_path: Path) -> None:
    path, _ = issued(tmp_path)
    settings = WebSettings(token_file=path)
    with (
        asyncio.Runner() as runner,
        asked_api(GeoPackageFeatures(tmp_path / "none.gpkg"), runner, settings) as api,
    ):
        assert api.get("/viewer").status_code == 308
        assert api.get("/versions").status_code == 401


def test_nothing_is_written_to_the_viewer(tmp_path: Path) -> None:
    with asyncio.Runner() as runner, asked_api(GeoPackageFeatures(tmp_path / "none.gpkg"), runner) as api:
        assert api.ask("POST", "/viewer/").status_code == 403
