"""What whoever asks is told of what they may do; and that listening takes nobody else's place."""

import asyncio
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from landmark_maps.examples import change, checkpoint, landmark
from map_http.asking import Api, asked_api, issued, problem
from map_http.corrections import MemoryCorrections
from trigpoint.landmarks.geopackage_features import GeoPackageFeatures
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint_landmarks.http.settings import WebSettings
from trigpoint_landmarks.http.tokens import Scope

PATIENCE_S = 10.0
Headers = dict[Scope, dict[str, str]]


@pytest.fixture
def database(tmp_path: Path) -> Path:
    path = tmp_path / "map.gpkg"
    with closing(GeoPackageStore(path)) as store:
        store.apply(change(1, opened=[landmark("A", 0.0, 0.0)]), checkpoint(1))
    return path


@pytest.fixture
def guarded(database: Path, tmp_path: Path) -> Iterator[tuple[Api, Headers]]:
    """A service with tokens, and a header for each scope; one request at a time."""
    tokens, headers = issued(tmp_path)
    settings = WebSettings(token_file=tokens, parallel_limit=1)
    with (
        asyncio.Runner() as runner,
        asked_api(GeoPackageFeatures(database), runner, settings, corrections=MemoryCorrections()) as api,
    ):
        yield api, headers


def test_who_has_no_token_is_told_that_one_is_needed(guarded: tuple[Api, Headers]) -> None:
    api, _ = guarded
    assert api.told("/access") == {
        "name": "anyone",
        "scope": None,
        "can_read": False,
        "can_label": False,
        "why_not_label": "a token with scope 'label' is needed",
    }
    assert problem(api.get("/labels"))["status"] == 401
    assert problem(api.get("/events"))["status"] == 401


@pytest.mark.parametrize(("scope", "can_label"), [(Scope.READ, False), (Scope.LABEL, True), (Scope.ADMINISTER, True)])
def test_who_has_a_token_is_told_what_it_allows(guarded: tuple[Api, Headers], scope: Scope, can_label: bool) -> None:
    api, headers = guarded
    found = api.get("/access", headers=headers[scope]).json()
    assert (found["name"], found["scope"], found["can_read"]) == (f"a-{scope.value}", scope.value, True)
    assert (found["can_label"], found["why_not_label"] == "") == (can_label, can_label)


def test_a_forged_token_is_refused_here_too(guarded: tuple[Api, Headers]) -> None:
    api, _ = guarded
    assert problem(api.get("/access", headers={"Authorization": "Bearer tp_forged"}))["status"] == 401


def test_without_a_token_file_nobody_writes_and_is_told_why(database: Path) -> None:
    with (
        asyncio.Runner() as runner,
        asked_api(GeoPackageFeatures(database), runner, corrections=MemoryCorrections()) as api,
    ):
        found = api.told("/access")
    assert (found["can_read"], found["can_label"]) == (True, False)
    assert found["why_not_label"] == "no token file is set: nothing can be written here"


def test_a_label_in_the_log_is_told_before_any_version_has_it(guarded: tuple[Api, Headers]) -> None:
    api, headers = guarded
    body = {"anchor": "a9", "image": "tile-1", "lat_deg": -33.9, "lon_deg": 151.2}
    assert api.ask("POST", "/anchors", json=body, headers=headers[Scope.LABEL]).status_code == 201
    (label,) = api.get("/labels", headers=headers[Scope.READ]).json()["labels"]
    assert (label["anchor"], label["position"], label["sigma_m"]) == ("a9", [151.2, -33.9], 0.1)


def test_who_listens_is_none_of_the_requests_under_way(guarded: tuple[Api, Headers]) -> None:
    api, headers = guarded
    first = asyncio.Event()

    async def listened() -> int:
        scope = _scope(headers[Scope.READ]["Authorization"])
        gone = asyncio.Event()
        listening = asyncio.create_task(api.served(scope, lambda: _when(gone), _telling(first)))
        await asyncio.wait_for(first.wait(), PATIENCE_S)
        answer = await api.asked("GET", "/versions", headers=headers[Scope.READ])
        gone.set()
        await asyncio.wait_for(listening, PATIENCE_S)
        return answer.status_code

    assert api.runner.run(listened()) == 200


async def _when(gone: asyncio.Event) -> dict[str, str]:
    await gone.wait()
    return {"type": "http.disconnect"}


def _telling(first: asyncio.Event) -> Any:
    async def send(message: Any) -> None:
        if message["type"] == "http.response.body":
            first.set()

    return send


def _scope(authorization: str) -> dict[str, Any]:
    return {
        "type": "http",
        "asgi": {"version": "3.0", "spec_version": "2.3"},
        "http_version": "1.1",
        "method": "GET",
        "scheme": "http",
        "path": "/events",
        "raw_path": b"/events",
        "query_string": b"",
        "root_path": "",
        "headers": [(b"host", b"127.0.0.1:8080"), (b"authorization", authorization.encode())],
        "client": ("127.0.0.1", 1234),
        "server": ("127.0.0.1", 8080),
    }
