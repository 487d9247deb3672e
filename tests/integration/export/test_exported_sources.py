"""What is exported is the same whichever database the map stands in; drives come from the log."""

import json
import shutil
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from command_runs.running import trigpoint
from event_examples.rows import imu_rows
from exported_maps.examples import fill, map_changes
from exported_maps.reading import read_layer
from landmark_maps.examples import checkpoint
from trigpoint.landmarks.postgis_store import PostgisStore
from trigpoint.logs.mcap_log import McapLog

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
