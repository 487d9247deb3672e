"""The HTTP service as a process: read by GDAL, labelled through, told of new versions, stopped."""

import json
import subprocess
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pyogrio
import pytest
from shapely import from_wkb, get_coordinates

from command_runs.processes import wait_until
from command_runs.running import trigpoint
from landmark_maps.examples import change, checkpoint, landmark, pin_frame
from map_features.examples import crowd, two_versions
from map_http.served import ServedMap, geopackage_line, served_map
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint.logs.mcap_log import McapLog

LABEL = {"anchor": "a9", "image": "tile-1", "lat_deg": -33.893, "lon_deg": 151.184, "sigma_m": 0.1}
MILLIMETRE_DEG = 1e-8


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("served") / "map.gpkg"
    with closing(GeoPackageStore(path)) as store:
        for number, one in enumerate(two_versions()):
            store.apply(one, checkpoint(number + 1))
    return path


@pytest.fixture(scope="module")
def served(database: Path) -> Iterator[ServedMap]:
    with served_map(database.parent, database=geopackage_line(database)) as found:
        yield found


def gdal_layer(served: ServedMap, layer: str, **options: Any) -> tuple[list[str], Any, Any]:
    """Names of a layer's ids, their coordinates (n, 2) as GDAL gives them, and what it says of the layer."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NO_PROXY", "127.0.0.1")
        meta, _, geometries, columns = pyogrio.raw.read(f"OAPIF:{served.url}", layer=layer, **options)
    names = [str(name) for name in meta["fields"]]
    return list(columns[names.index("landmark")]), get_coordinates(from_wkb(geometries)), meta


@pytest.mark.parametrize("crs", ["OGC:CRS84", "EPSG:4326"])
def test_gdal_reads_every_landmark_where_it_is(served: ServedMap, crs: str) -> None:
    names, at_deg, _ = gdal_layer(served, "landmarks", CRS=crs, PAGE_SIZE="70")
    rows = {row.landmark: row for row in (*crowd(), *two_versions()[1].opened)}
    assert sorted(names) == sorted(rows)
    assert np.abs(at_deg - [(rows[name].lon_deg, rows[name].lat_deg) for name in names]).max() < MILLIMETRE_DEG


def test_gdal_reads_the_map_s_own_grid_in_its_order_of_axes(served: ServedMap) -> None:
    names, at_m, meta = gdal_layer(served, "landmarks")  # it is GDAL's choice where it is offered
    rows = {row.landmark: row for row in (*crowd(), *two_versions()[1].opened)}
    assert np.abs(at_m - [(rows[name].easting_m, rows[name].northing_m) for name in names]).max() < 1e-3
    assert "32756" in meta["crs"]


def test_gdal_asks_for_a_box_and_a_condition(served: ServedMap) -> None:
    box_m = (332_000.0, 6_247_500.0, 332_500.0, 6_248_500.0)
    names, at_m, _ = gdal_layer(served, "landmarks", bbox=box_m, where="kind = 'pole'")
    assert 0 < len(names) < 100
    assert ((at_m >= box_m[:2]) & (at_m <= box_m[2:])).all()


def test_gdal_s_own_program_counts_every_layer(served: ServedMap) -> None:
    said = subprocess.run(
        ["ogrinfo", "-ro", "-al", "-so", f"OAPIF:{served.url}"], capture_output=True, text=True, check=True, timeout=60
    ).stdout
    assert [line for line in said.splitlines() if line.startswith("Layer name")] == [
        f"Layer name: {name}" for name in ("landmarks", "trajectories", "anchors", "drives", "image_offsets")
    ]
    assert "Feature Count: 300" in said


def test_gdal_reads_tiles_where_landmarks_are(served: ServedMap) -> None:
    tile = "15/30144/19666"
    meta, _, geometries, columns = pyogrio.raw.read(f"MVT:{served.url}/tiles/landmarks/{tile}.pbf")
    at_m = get_coordinates(from_wkb(geometries))
    names = list(columns[list(meta["fields"]).index("landmark")])
    rows = {row.landmark: row for row in (*crowd(), *two_versions()[1].opened)}
    radius_m = 6_378_137.0
    expected = [
        (radius_m * np.radians(rows[name].lon_deg), radius_m * np.arcsinh(np.tan(np.radians(rows[name].lat_deg))))
        for name in names
    ]
    unit_m = 40_075_016.69 / 2**15 / 4096
    assert len(names) > 50
    assert np.abs(at_m - expected).max() <= unit_m


def test_a_new_version_is_served_soon(tmp_path: Path) -> None:
    path = tmp_path / "map.gpkg"
    with closing(GeoPackageStore(path)) as store:
        store.apply(change(1, opened=[landmark("A", 0.0, 0.0)]), checkpoint(1))
        with served_map(tmp_path, database=geopackage_line(path)) as served:
            assert served.told("/versions")["map_version"] == 1
            store.apply(change(2, opened=[landmark("B", 5.0, 0.0)]), checkpoint(2))
            wait_until(lambda: bool(served.told("/versions")["map_version"] == 2), "the new version")
            assert served.told("/collections/landmarks/items")["numberMatched"] == 2


def test_a_label_by_http_is_in_the_log_as_one_by_command(tmp_path: Path) -> None:
    tokens, data = tmp_path / "tokens.json", tmp_path / "data"
    with closing(McapLog(data / "log")) as log:
        pin_frame(log)
    path = data / "landmarks.gpkg"
    with closing(GeoPackageStore(path)) as store:
        store.apply(change(1, opened=[landmark("A", 0.0, 0.0)]), checkpoint(1))
    issued = trigpoint("tokens", "issue", "ann", "--scope", "label", "--file", tokens, "--json").answer["token"]
    web = f"token_file = {json.dumps(str(tokens))}"
    with served_map(tmp_path, database=geopackage_line(path), web=web, data=data) as served:
        assert sent(served, "POST", "/anchors", issued, LABEL) == 201
        assert sent(served, "POST", "/anchors", issued, LABEL) == 200
        (label,) = labels_in_force(served, issued)
        assert (label["anchor"], label["position"], label["sigma_m"]) == ("a9", [151.184, -33.893], 0.1)
        assert label["stamp_ns"] > 0
        assert sent(served, "DELETE", "/anchors/a9?reason=wrong", issued) == 200
        assert labels_in_force(served, issued) == []
        assert sent(served, "DELETE", "/anchors/other", issued) == 404
        assert sent(served, "POST", "/anchors", issued, {**LABEL, "lat_deg": 50.0}) == 400
        assert sent(served, "POST", "/anchors", "tp_forged", LABEL) == 401
        trigpoint("tokens", "revoke", "ann", "--file", tokens)
        wait_until(lambda: sent(served, "GET", "/versions", issued) == 401, "revoked")
        assert issued not in served.said.read_text(encoding="utf-8")
    (anchor,) = trigpoint("anchors", "list", "--data", data, "--json").answer["anchors"]["items"]
    assert (anchor["anchor"], anchor["lat_deg"], anchor["in_force"]) == ("a9", -33.893, False)
    assert anchor["retracted"] == {"author": "ann", "reason": "wrong"}


def labels_in_force(served: ServedMap, token: str) -> list[Any]:
    request = urllib.request.Request(f"{served.url}/labels", headers={"Authorization": f"Bearer {token}"})
    with urllib.request.urlopen(request, timeout=30.0) as answer:
        found: list[Any] = json.load(answer)["labels"]
        return found


def sent(served: ServedMap, method: str, path: str, token: str, body: object = None) -> int:
    """The status of a request with a token."""
    content = None if body is None else json.dumps(body).encode()
    headers = {"Authorization": f"Bearer {token}", "Content-Type": "application/json"}
    request = urllib.request.Request(f"{served.url}{path}", data=content, headers=headers, method=method)
    try:
        with urllib.request.urlopen(request, timeout=30.0) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code


def test_a_process_told_to_stop_ends_well(tmp_path: Path, database: Path) -> None:
    with served_map(tmp_path, database=geopackage_line(database)) as served:
        served.popen.terminate()
        assert served.popen.wait(30.0) == 0


def test_who_listens_does_not_hold_up_the_end(tmp_path: Path, database: Path) -> None:
    with (
        served_map(tmp_path, database=geopackage_line(database)) as served,
        urllib.request.urlopen(f"{served.url}/events", timeout=30.0) as listening,
    ):
        assert listening.headers["content-type"].startswith("text/event-stream")
        assert listening.readline() == b"event: version\n"
        served.popen.terminate()
        assert served.popen.wait(4.0) == 0  # s: less than requests under way are given
        assert listening.read().endswith(b"\n\n")


def test_a_process_without_a_database_waits_for_one(tmp_path: Path) -> None:
    path = tmp_path / "later.gpkg"
    GeoPackageStore(path).close()
    with served_map(tmp_path, database=geopackage_line(path)) as served:
        assert served.answers("/healthz") == 200
        path.unlink()
        wait_until(lambda: served.answers("/readyz") == 503, "not ready")
        with closing(GeoPackageStore(path)) as store:
            store.apply(change(1, opened=[landmark("A", 0.0, 0.0)]), checkpoint(1))
        wait_until(lambda: served.answers("/readyz") == 200, "ready again")
        wait_until(lambda: bool(served.told("/versions")["map_version"] == 1), "the map that was made anew")
