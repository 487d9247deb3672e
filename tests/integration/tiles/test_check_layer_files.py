"""The check layer as GIS programs read it."""

import json
from pathlib import Path

import numpy as np
import pytest
from shapely import get_coordinates

from exported_maps.reading import read_layer
from qgis_reading.project import ran_in_qgis
from registered_images.examples import CRS, EAST_M, NORTH_M, SIDE_M, registered, tile
from trigpoint.errors import InputError
from trigpoint.landmarks.geopackage_writing import read_handed_over
from trigpoint_tiles.check_layer_files import TABLE, write_check_layer
from trigpoint_tiles.core.check_style import USUAL_SCALE

STYLED = Path(__file__).parents[2] / "qgis_reading" / "styled.py"
FOUND = registered(
    tile(0, (0.1, 0.05)), tile(1, (0.3, -0.2)), tile(2, (-0.6, 0.5)), tile(3, (0.0, 0.0), refused="dark")
)


@pytest.fixture
def geopackage(tmp_path: Path) -> Path:
    path = tmp_path / "shifts.gpkg"
    write_check_layer(path, FOUND, image="north")
    return path


def test_a_geopackage_has_the_tiles_on_the_layer_s_own_grid(geopackage: Path) -> None:
    read = read_layer(geopackage, TABLE)
    assert read.crs == CRS
    assert get_coordinates(read.geometries)[1].tolist() == [EAST_M + SIDE_M, NORTH_M]
    assert read.columns["shift_north_m"][:3] == [0.05, -0.2, 0.5]
    assert np.isnan(read.columns["shift_north_m"][3])
    assert read.columns["refused"] == [None, None, None, "dark"]
    assert set(read.columns["map_version"]) == {3}


def test_a_geopackage_says_of_which_image_and_map_version_it_is(geopackage: Path) -> None:
    said = json.loads(read_handed_over(geopackage).metadata)
    assert said == {"image": "north", "map_version": 3, "crs": CRS, "pixel_m": 0.2}


def test_the_same_registration_is_the_same_file(geopackage: Path, tmp_path: Path) -> None:
    write_check_layer(tmp_path / "again.gpkg", FOUND, image="north")
    assert geopackage.read_bytes() == (tmp_path / "again.gpkg").read_bytes()


@pytest.mark.qgis
def test_qgis_draws_arrows_by_their_length_and_refused_tiles_without(geopackage: Path, tmp_path: Path) -> None:
    picture = tmp_path / "shifts.png"
    tiles = json.loads(ran_in_qgis(STYLED, f"{geopackage}|layername={TABLE}", str(picture)))
    assert [one["category"] for one in tiles] == ["up to 0.2 m", "up to 0.5 m", "over 0.5 m", "refused"]
    (left_m, bottom_m, right_m, top_m), *_ = tiles[1]["generated_m"]
    assert (right_m - left_m, top_m - bottom_m) == pytest.approx((0.3 * USUAL_SCALE, 0.2 * USUAL_SCALE))
    assert tiles[3]["generated_m"] == []


@pytest.mark.parametrize("name", ["shifts.gpkg", "shifts.geojson"])
def test_a_folder_that_is_not_there_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=f"missing/{name}: cannot be written"):
        write_check_layer(tmp_path / "missing" / name, FOUND, image="north")
