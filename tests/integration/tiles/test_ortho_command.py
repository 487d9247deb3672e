"""`trigpoint ortho`: what it says, and how it refuses."""

import json
from pathlib import Path

import numpy as np
import pytest
import rasterio
from click.testing import CliRunner, Result
from rasterio.transform import from_origin

from airborne_points.ign import airborne_layer
from exported_maps.reading import read_layer
from scanned_drives.examples import arc, drive_rows, map_rows, pinned, solved_path
from trigpoint.logs.mcap_log import McapLog
from trigpoint_cli.ortho import command
from trigpoint_tiles.check_layer_files import TABLE

POSES = arc(2.0)
LAYERS = (TABLE, "test_data_rgb")  # the check layer's name in a GeoPackage and in GeoJSON


def asked(*words: str) -> Result:
    return CliRunner().invoke(command, list(words))


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A data directory with one scanned drive."""
    log = McapLog(tmp_path / "data" / "log")
    log.append("map", [pinned()])
    log.append("veh-car", drive_rows("car", POSES))
    log.append("optimisation", map_rows([solved_path("car", POSES)]))
    log.close()
    return tmp_path / "data"


def test_render_says_what_it_made_as_one_json_object(data: Path, tmp_path: Path) -> None:
    words = ("--data", str(data), "--out", str(tmp_path / "out"), "--resolution-m", "0.5", "--json")
    said = json.loads(asked("render", *words).stdout)
    assert said["map_version"] == 1
    assert [grid["drives"]["car/b"]["sweeps"] for grid in said["grids"]] == [20, 20]
    assert all(Path(file).exists() for file in said["files"])


def test_a_format_nobody_knows_is_refused_naming_those_there_are(data: Path, tmp_path: Path) -> None:
    found = asked("render", "--data", str(data), "--out", str(tmp_path), "--format", "cog,bmp")
    assert "no bmp; there are cog, pmtiles, xyz" in str(found.exception)


def test_an_image_without_a_crs_is_refused_by_name(data: Path, tmp_path: Path) -> None:
    asked("render", "--data", str(data), "--out", str(tmp_path / "out"), "--resolution-m", "0.5", "--format", "cog")
    image = tmp_path / "aerial.tif"
    shape = {"width": 8, "height": 8, "count": 1, "dtype": "uint8", "transform": from_origin(0.0, 8.0, 1.0, 1.0)}
    with rasterio.open(image, "w", driver="GTiff", **shape) as raster:
        raster.write(np.ones((1, 8, 8), dtype=np.uint8))
    found = asked("register", "--ortho", str(tmp_path / "out/ortho.tif"), "--image", str(image))
    assert "aerial.tif: the image has no CRS" in str(found.exception)


@pytest.mark.data
def test_igns_orthophoto_lies_on_its_airborne_points_to_a_pixel(recorded_drives: Path, tmp_path: Path) -> None:
    folder, layer = recorded_drives / "ign_lidar_hd", tmp_path / "ign.tif"
    airborne_layer(folder, layer, resolution_m=0.2)
    image = folder / "test_data_rgb.tif"
    words = ("--out", str(tmp_path / "shifts.gpkg"), "--data", str(tmp_path), "--json")
    said = json.loads(asked("register", "--ortho", str(layer), "--image", str(image), *words).stdout)
    (tile,) = said["tiles"]["items"]
    assert np.hypot(*said["shift_m"].values()) < 0.2
    assert tile["confidence"] > 0.95
    assert tile["refused"] is None
    assert said["files"] == [str(tmp_path / "shifts.gpkg"), str(tmp_path / "shifts" / "test_data_rgb.geojson")]
    for_gis, for_viewer = (read_layer(Path(file), name) for file, name in zip(said["files"], LAYERS, strict=True))
    assert (for_gis.crs, for_viewer.crs) == ("EPSG:2154", "EPSG:4326")
    assert for_gis.columns == for_viewer.columns


def test_a_data_directory_that_is_not_there_is_named_before_anything_is_measured(tmp_path: Path) -> None:
    missing = tmp_path / "missing"
    found = asked("register", "--ortho", "no.tif", "--image", "no.png", "--data", str(missing))
    assert str(found.exception).startswith(f"{missing}: no such data directory")
