"""What is exported is the same whichever database the map stands in; drives come from the log."""

import json
import shutil
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command_runs.running import trigpoint
from event_examples.rows import imu_rows
from exported_maps.examples import fill, map_changes
from exported_maps.reading import SUFFIXES, read_layer
from landmark_maps.examples import change, checkpoint, landmark
from trigpoint.geodesy.projection import WGS84, transform_coordinates
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint.landmarks.postgis_store import PostgisStore
from trigpoint.logs.mcap_log import McapLog

LOCAL = "+proj=tmerc +lat_0=-33.9 +lon_0=151.2 +k=1 +x_0=300000 +y_0=6000000 +datum=WGS84 +units=m +type=crs"
LAYERS = ("landmarks", "trajectories", "anchors", "image_offsets")


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fill(tmp_path_factory.mktemp("data"))


def collection(data: Path, path: Path, layer: str, *words: str | int) -> dict[str, Any]:
    """A layer as GeoJSON, its features in order of id."""
    run = trigpoint("export", "geojson", "--data", data, "--out", path, "--layer", layer, *words)
    assert run.status == 0, run.err
    found: dict[str, Any] = json.loads(path.read_bytes())
    return {**found, "features": sorted(found["features"], key=lambda one: str(one["id"]))}


@pytest.mark.postgis
@pytest.mark.parametrize("as_of", [1, 2])
def test_both_databases_give_the_same_features(data: Path, postgis_url: str, tmp_path: Path, as_of: int) -> None:
    with closing(PostgisStore(postgis_url)) as store:
        for number, one in enumerate(map_changes()):
            store.apply(one, checkpoint(number + 1))
    for layer in LAYERS:
        of_file = collection(data, tmp_path / f"{layer}-file.geojson", layer, "--as-of", as_of)
        words = ("--as-of", as_of, "--database", postgis_url)
        assert collection(data, tmp_path / f"{layer}-server.geojson", layer, *words) == of_file


def test_drives_are_those_of_the_log(data: Path, tmp_path: Path) -> None:
    own = tmp_path / "data"
    own.mkdir()
    shutil.copyfile(data / "landmarks.gpkg", own / "landmarks.gpkg")
    with closing(McapLog(own / "log")) as log:
        log.append("veh-van", imu_rows(0, 10))
    path = tmp_path / "map.gpkg"
    run = trigpoint("export", "gpkg", "--data", own, "--out", path, "--json")
    assert run.answer["features"]["drives"] == 1
    drives = read_layer(path, "drives").columns
    assert (drives["vehicle"], drives["boot_id"], drives["excluded"]) == (["van"], ["boot-1"], [False])


def test_without_a_log_there_are_all_layers_but_drives(data: Path, tmp_path: Path) -> None:
    run = trigpoint("export", "gpkg", "--data", data, "--out", tmp_path / "map.gpkg", "--json")
    assert tuple(run.answer["features"]) == LAYERS
    assert not (data / "log").exists()


def test_a_map_without_a_version_cannot_be_exported(tmp_path: Path) -> None:
    run = trigpoint("export", "gpkg", "--data", tmp_path, "--out", tmp_path / "map.gpkg")
    assert run.status == 2
    assert "no landmark database" in run.err


@pytest.mark.parametrize("form", sorted(SUFFIXES))
def test_a_map_in_a_crs_without_a_code_is_exported_all_the_same(tmp_path: Path, form: str) -> None:
    own, path = tmp_path / "data", tmp_path / f"map.{SUFFIXES[form]}"
    own.mkdir()
    row = landmark("A", 0.0, 0.0)
    x, y = transform_coordinates(np.array([row.lon_deg]), np.array([row.lat_deg]), source_crs=WGS84, target_crs=LOCAL)
    with closing(GeoPackageStore(own / "landmarks.gpkg")) as store:
        placed = row._replace(easting_m=float(x[0]), northing_m=float(y[0]))
        store.apply(change(1, opened=[placed], crs=LOCAL), checkpoint(1))
    run = trigpoint("export", form, "--data", own, "--out", path)
    assert run.status == 0, run.err
    expected = (row.lon_deg, row.lat_deg) if form in ("geojson", "kml") else (float(x[0]), float(y[0]))
    assert read_layer(path).places["A"] == pytest.approx(expected, abs=1e-8 if form in ("geojson", "kml") else 1e-3)
