"""What the HTTP service refuses, each as a problem and without a word about its inside."""

import asyncio
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from landmark_maps.examples import checkpoint
from map_features.examples import two_versions
from map_http.asking import Api, asked_api, issued, problem
from map_http.corrections import MemoryCorrections
from trigpoint.errors import InputError
from trigpoint.landmarks.geopackage_features import GeoPackageFeatures
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint_landmarks.http.settings import WebSettings
from trigpoint_landmarks.http.tokens import Scope, issue_token, read_tokens, revoke_token

ITEMS = "/collections/landmarks/items"
LABEL = {"anchor": "a1", "image": "tile-1", "lat_deg": -33.89, "lon_deg": 151.18, "sigma_m": 0.1}
INJECTIONS = (
    "' OR '1'='1",
    "kind = 'x'; DROP TABLE landmarks",
    "kind = 'x' --",
    "kind = 'x' UNION SELECT * FROM map_versions",
    "pg_sleep(5) = 1",
    'kind = (SELECT "crs" FROM map_versions)',
    '"kind; DROP TABLE landmarks" = 1',
    "kind::text = 'x'",
    "%(v0)s = 1",
    "fid = 1",
    "geom = 'x'",
    "1",
    "",
    "(",
)


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("refusals") / "map.gpkg"
    with closing(GeoPackageStore(path)) as store:
        store.apply(two_versions()[0], checkpoint(1))
    return path


@pytest.fixture
def runner() -> Iterator[asyncio.Runner]:
    with asyncio.Runner() as runner:
        yield runner


@pytest.fixture
def api(database: Path, runner: asyncio.Runner) -> Iterator[Api]:
    with asked_api(GeoPackageFeatures(database), runner, corrections=MemoryCorrections()) as found:
        yield found


@pytest.fixture
def headers(tmp_path: Path) -> dict[Scope, dict[str, str]]:
    return issued(tmp_path)[1]


@pytest.fixture
def guarded(
    database: Path, runner: asyncio.Runner, headers: dict[Scope, dict[str, str]], tmp_path: Path
) -> Iterator[Api]:
    settings = WebSettings(token_file=tmp_path / "tokens.json", body_limit_bytes=512)
    with asked_api(GeoPackageFeatures(database), runner, settings, corrections=MemoryCorrections()) as found:
        yield found


@pytest.mark.parametrize("text", INJECTIONS)
def test_a_filter_that_is_no_condition_is_refused(api: Api, text: str) -> None:
    assert problem(api.get(ITEMS, params={"filter": text}))["status"] == 400


@pytest.mark.parametrize("text", ["'; DROP TABLE landmarks; --", "' OR 1=1 --", "%s %(v0)s", "\\", "$1"])
def test_a_value_is_only_ever_a_value(api: Api, text: str) -> None:
    assert api.ids(ITEMS, kind=text) == []
    assert api.ids(ITEMS, filter="kind = '" + text.replace("'", "''") + "'") == []
    assert problem(api.get(f"{ITEMS}/{text.replace('%', '%25')}"))["status"] == 404
    assert len(api.ids(ITEMS, limit=1000)) == 300


@pytest.mark.parametrize(
    "parameters",
    [
        {"limit": "0"},
        {"limit": "-1"},
        {"limit": "1e3"},
        {"limit": "９"},
        {"bbox": "1,2,3"},
        {"bbox": "a,b,c,d"},
        {"bbox": "nan,0,1,1"},
        {"bbox": "1,2,3,1e999"},
        {"bbox": "0,5,1,4"},
        {"bbox": "0,100,1,120"},
        {"bbox-crs": "EPSG:4326"},
        {"crs": "http://example.com/evil"},
        {"datetime": "yesterday"},
        {"datetime": "2023-13-01"},
        {"datetime": "2024-01-01/2023-01-01"},
        {"datetime": "../.."},
        {"datetime": "1/2/3"},
        {"filter-lang": "sql"},
        {"filter": "{", "filter-lang": "cql2-json"},
        {"filter": "[" * 5000, "filter-lang": "cql2-json"},
        {"filter": "(" * 3000 + "kind='a'" + ")" * 3000},
        {"filter": "not " * 3000 + "anchored"},
        {"filter": "sigma_major_m > " + "-" * 8000 + "1"},
        {"filter": "kind = '" + "x" * 20_000 + "'"},
        {"filter": "kind < 1"},
        {"filter": "kind LIKE 'a\\'"},
        {"filter": "S_INTERSECTS(geometry, POLYGON((0 0,1 1,0 1,1 0,0 0)))"},
        {"filter": "S_INTERSECTS(geometry, POINT(500 0))"},
        {"filter": "x_m * 1e300 * 1e300 > 0"},
        {"as_of": "newest"},
        {"anchored": "maybe"},
        {"x_m": "east"},
        {"f": "html"},
        {"unknown": "1"},
        {"kind": "a\0b"},
    ],
)
def test_a_parameter_that_cannot_be_is_refused(api: Api, parameters: dict[str, str]) -> None:
    assert problem(api.get(ITEMS, params=parameters))["status"] == 400


@pytest.mark.parametrize("query", ["limit=1&limit=2", "kind=%ff", "&".join(f"p{n}=1" for n in range(60))])
def test_parameters_that_cannot_be_read_are_refused(api: Api, query: str) -> None:
    assert problem(api.get(f"{ITEMS}?{query}"))["status"] == 400


@pytest.mark.parametrize(
    "path",
    [
        "/collections/../../etc/passwd",
        "/collections/%2e%2e%2f%2e%2e%2fetc%2fpasswd",
        "/tiles/..%2f..%2fetc/0/0/0",
        "/tiles/landmarks/0/0/..%2f..%2f0",
        "/v/..%2f1/tiles/landmarks/0/0/0",
        "/collections/landmarks/items/..%2f..%2f..%2fetc%2fpasswd",
        "/static/../settings.py",
    ],
)
def test_a_path_leads_nowhere_else(api: Api, path: str) -> None:
    assert problem(api.get(path))["status"] == 404


def test_a_method_that_is_not_there_is_a_problem(guarded: Api, headers: dict[Scope, dict[str, str]]) -> None:
    administering = headers[Scope.ADMINISTER]
    assert problem(guarded.ask("PUT", ITEMS, headers=administering))["status"] == 405
    assert problem(guarded.ask("GET", "/anchors", headers=administering))["status"] == 405


def test_without_a_token_file_nothing_is_written(api: Api) -> None:
    assert problem(api.ask("POST", "/anchors", json=LABEL))["status"] == 403
    assert problem(api.ask("DELETE", "/anchors/a1"))["status"] == 403
    assert problem(api.ask("POST", "/anchors", json=LABEL, headers={"Authorization": "Bearer x"}))["status"] == 401


def test_without_a_token_file_other_hosts_names_are_not_served(api: Api) -> None:
    assert problem(api.get("/", headers={"Host": "evil.example"}))["status"] == 421
    assert api.get("/", headers={"Host": "localhost:8080"}).status_code == 200


@pytest.mark.parametrize(
    "header",
    [
        "",
        "Bearer",
        "Bearer ",
        "Bearer tp_" + "A" * 43,
        "Basic dXNlcjpwYXNz",
        "Bearer " + "x" * 2000,
        "bearer \u00ff",
        "Bearer ' OR 1=1",
    ],
)
def test_a_forged_token_is_refused(guarded: Api, header: str) -> None:
    answer = guarded.get(ITEMS, headers=[(b"authorization", header.encode("latin-1"))])
    assert problem(answer)["status"] == 401
    assert answer.headers["www-authenticate"].startswith("Bearer")


def test_a_hash_is_no_token(guarded: Api, tmp_path: Path) -> None:
    digest = read_tokens(tmp_path / "tokens.json").rows[0].digest
    assert problem(guarded.get(ITEMS, headers={"Authorization": f"Bearer {digest}"}))["status"] == 401


def test_without_a_token_reading_is_refused_where_there_are_tokens(guarded: Api) -> None:
    assert [problem(guarded.get(path))["status"] for path in ("/", ITEMS, "/tiles/landmarks/0/0/0")] == [401] * 3


def test_a_scope_allows_what_it_says_and_no_more(guarded: Api, headers: dict[Scope, dict[str, str]]) -> None:
    read, label, administer = (headers[scope] for scope in Scope)
    assert [guarded.get("/", headers=one).status_code for one in (read, label, administer)] == [200, 200, 200]
    labelled = [guarded.ask("POST", "/anchors", json=LABEL, headers=one) for one in (read, label, administer)]
    assert [one.status_code for one in labelled] == [403, 201, 200]
    path = "/drives/veh-a/exclude"
    excluded = [guarded.ask("POST", path, json={}, headers=one).status_code for one in (read, label, administer)]
    assert excluded == [403, 403, 200]


def test_a_revoked_token_is_refused(database: Path, runner: asyncio.Runner, tmp_path: Path) -> None:
    path, secrets = issued(tmp_path, Scope.READ)
    revoke_token(path, "a-read")
    with asked_api(GeoPackageFeatures(database), runner, WebSettings(token_file=path)) as api:
        assert problem(api.get("/", headers=secrets[Scope.READ]))["status"] == 401


def test_open_reading_needs_no_token_and_writing_does(database: Path, runner: asyncio.Runner, tmp_path: Path) -> None:
    path, secrets = issued(tmp_path, Scope.LABEL)
    settings = WebSettings(token_file=path, open_reading=True)
    with asked_api(GeoPackageFeatures(database), runner, settings, corrections=MemoryCorrections()) as api:
        assert api.get("/").status_code == 200
        assert "public" in api.get("/tiles/landmarks/0/0/0").headers["cache-control"]
        assert problem(api.ask("POST", "/anchors", json=LABEL))["status"] == 403
        assert api.ask("POST", "/anchors", json=LABEL, headers=secrets[Scope.LABEL]).status_code == 201


def test_a_body_that_is_too_large_is_refused(guarded: Api, headers: dict[Scope, dict[str, str]]) -> None:
    label = headers[Scope.LABEL]
    announced = guarded.ask("POST", "/anchors", content=b"x" * 513, headers=label)
    assert problem(announced)["status"] == 413

    async def parts() -> object:
        yield b"x" * 300
        yield b"x" * 300

    assert problem(guarded.ask("POST", "/anchors", content=parts(), headers=label))["status"] == 413


@pytest.mark.parametrize(
    "body",
    [
        "",
        "[]",
        "{",
        '{"anchor": "a"}',
        '{"anchor": "a", "lat_deg": 1, "lon_deg": 2, "admin": true}',
        '{"anchor": "a", "lat_deg": "1", "lon_deg": 2}',
        '{"anchor": "a", "lat_deg": 91, "lon_deg": 2}',
        '{"anchor": "a", "lat_deg": NaN, "lon_deg": 2}',
        '{"anchor": "a", "lat_deg": 1, "lon_deg": 2, "sigma_m": 0}',
        '{"anchor": "", "lat_deg": 1, "lon_deg": 2}',
        '{"anchor": "a\\u0000", "lat_deg": 1, "lon_deg": 2}',
        '{"anchor": "\\ud800", "lat_deg": 1, "lon_deg": 2}',
        '{"anchor": "' + "a" * 201 + '", "lat_deg": 1, "lon_deg": 2}',
    ],
)
def test_a_label_that_is_none_is_refused(guarded: Api, headers: dict[Scope, dict[str, str]], body: str) -> None:
    sent = {**headers[Scope.LABEL], "Content-Type": "application/json"}
    assert problem(guarded.ask("POST", "/anchors", content=body, headers=sent))["status"] == 422


def test_what_the_log_refuses_is_the_caller_s_to_mend(guarded: Api, headers: dict[Scope, dict[str, str]]) -> None:
    label = headers[Scope.LABEL]
    far = guarded.ask("POST", "/anchors", json={**LABEL, "anchor": "far"}, headers=label)
    assert "too far" in problem(far)["detail"]
    assert problem(guarded.ask("DELETE", "/anchors/nobody", headers=label))["status"] == 404


def test_a_correction_is_attributed_to_its_token(guarded: Api, headers: dict[Scope, dict[str, str]]) -> None:
    guarded.ask("POST", "/anchors", json=LABEL, headers=headers[Scope.LABEL])
    guarded.ask("DELETE", "/anchors/a1?image=tile-1&reason=wrong", headers=headers[Scope.LABEL])
    body = {"boot_id": "b1", "reason": "fog"}
    guarded.ask("POST", "/drives/veh-a/exclude", json=body, headers=headers[Scope.ADMINISTER])
    assert isinstance(guarded.corrections, MemoryCorrections)
    assert guarded.corrections.said == [
        ("label", "a1"),
        ("retract", "a1", "tile-1", "a-label", "wrong"),
        ("exclude", "veh-a", "b1", "a-administer", "fog"),
    ]


def test_asking_too_often_is_refused_with_when_to_come_back(database: Path, runner: asyncio.Runner) -> None:
    settings = WebSettings(rate_hz=0.01, burst=2)
    with asked_api(GeoPackageFeatures(database), runner, settings) as api:
        assert [api.get("/").status_code for _ in range(2)] == [200, 200]
        refused = api.get("/")
        assert problem(refused)["status"] == 429
        assert int(refused.headers["retry-after"]) > 50
        assert api.get("/", client="10.0.0.9").status_code == 200


def test_only_listed_origins_may_call_from_a_browser(database: Path, runner: asyncio.Runner) -> None:
    settings = WebSettings(origins=("https://maps.example",))
    with asked_api(GeoPackageFeatures(database), runner, settings) as api:
        listed = api.get("/", headers={"Origin": "https://maps.example"})
        other = api.get("/", headers={"Origin": "https://evil.example"})
    assert listed.headers["access-control-allow-origin"] == "https://maps.example"
    assert "access-control-allow-origin" not in other.headers


def test_an_error_nobody_expected_says_nothing_of_the_inside(api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    async def broken() -> None:
        raise RuntimeError("secret inside")

    monkeypatch.setattr(api.watch, "current", broken)
    for path in (ITEMS, "/collections"):
        found = problem(api.get(path))
        assert found["status"] == 500
        assert "secret" not in found["detail"]


def test_a_database_that_is_not_there_yet_is_away(runner: asyncio.Runner, tmp_path: Path) -> None:
    with asked_api(GeoPackageFeatures(tmp_path / "none.gpkg"), runner) as api:
        answer = api.get(ITEMS)
        assert problem(answer)["status"] == 503
        assert answer.headers["retry-after"] == "1"
        assert api.get("/conformance").status_code == 200


def test_a_map_without_a_version_is_empty(runner: asyncio.Runner, tmp_path: Path) -> None:
    GeoPackageStore(tmp_path / "empty.gpkg").close()
    with asked_api(GeoPackageFeatures(tmp_path / "empty.gpkg"), runner) as api:
        assert api.told(ITEMS)["features"] == []
        assert api.told("/versions")["versions"] == []
        assert api.get("/tiles/landmarks/0/0/0").status_code == 204
        assert api.told("/collections/landmarks")["crs"] == ["http://www.opengis.net/def/crs/OGC/1.3/CRS84"]


def test_everything_sent_forbids_guessing_its_kind(api: Api) -> None:
    assert api.get("/").headers["x-content-type-options"] == "nosniff"
    assert api.get("/nothing").headers["x-content-type-options"] == "nosniff"


def test_a_host_reached_from_elsewhere_needs_tokens(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="token_file or open_reading"):
        WebSettings(host="0.0.0.0")
    issue_token(tmp_path / "t.json", "a", Scope.READ, now_s=0)
    assert WebSettings(host="0.0.0.0", token_file=tmp_path / "t.json").host == "0.0.0.0"
