"""Aerial pictures of a campus: what is seen lies where its image has it, in tiles that agree from zoom to zoom."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from command_runs.small_campus import SEED, small_settings
from trigpoint.geodesy.projection import wgs84_from_map_points
from trigpoint.geodesy.web_tiles import WebTile, tile_coordinates
from trigpoint_vehicle.aerial_files import PictureFolder, viewer_configuration, write_pictures
from trigpoint_vehicle.core.aerial import AROUND_M, POLE, ZOOM_LEAST, ZOOM_MOST, AerialPicture, aerial_pictures
from trigpoint_vehicle.core.campus import Campus, simulate_campus

Floats = NDArray[np.float64]
Tiles = dict[WebTile, Image.Image]


@pytest.fixture(scope="module")
def campus() -> Campus:
    return simulate_campus(SEED, small_settings())


@pytest.fixture(scope="module")
def west(campus: Campus) -> AerialPicture:
    """The western one of two pictures."""
    return next(aerial_pictures(campus, small_settings(), seed=SEED))


@pytest.fixture(scope="module")
def tiles(west: AerialPicture) -> Tiles:
    return dict(west.tiles())


def pixel(tiles: Tiles, campus: Campus, place_m: Floats, zoom: int = ZOOM_MOST) -> tuple[int, ...]:
    """What is seen at a place of the map frame; nothing where there is no tile."""
    lat_deg, lon_deg = wgs84_from_map_points(place_m[None, :], campus.frame)
    column, row = (float(each[0]) for each in tile_coordinates(lat_deg, lon_deg, zoom))
    tile = tiles.get(WebTile(zoom, int(column), int(row)))
    found = (0, 0, 0, 0) if tile is None else tile.getpixel((int(column % 1 * 256), int(row % 1 * 256)))
    assert isinstance(found, tuple)
    return tuple(int(one) for one in found)


def poles_in_the_west(campus: Campus) -> Floats:
    place_m, kinds = campus.landmarks.position_m, np.array(campus.landmarks.kind)
    inside = (place_m[:, 0] < small_settings().streets.width_m / 2) & (kinds == "pole")
    found: Floats = place_m[inside]
    return found


def test_poles_are_seen_where_the_image_has_them(campus: Campus, tiles: Tiles) -> None:
    at_m = poles_in_the_west(campus) + campus.imagery.offset_m[0]
    seen = [pixel(tiles, campus, one) == POLE for one in at_m]
    assert len(seen) > 30
    assert all(seen)


def test_beside_the_picture_s_own_ground_nothing_is_shown(campus: Campus, tiles: Tiles) -> None:
    settings = small_settings().streets
    inside_m = np.array([10.0, settings.height_m / 2])
    outside_m = np.array([settings.width_m / 2 + 2.0 * AROUND_M, settings.height_m / 2])
    assert (pixel(tiles, campus, inside_m)[3], pixel(tiles, campus, outside_m)[3]) == (255, 0)


@pytest.mark.parametrize("zoom", [19, 18, 17])
def test_streets_are_at_the_same_place_in_every_zoom(campus: Campus, tiles: Tiles, zoom: int) -> None:
    streets = campus.streets
    begin, end = streets.street[0]  # in the west
    middle_m = streets.junction_m[[begin, end]].mean(axis=0) + campus.imagery.offset_m[0]
    red, green, blue, _ = pixel(tiles, campus, middle_m, zoom)
    assert max(red, green, blue) - min(red, green, blue) < 12  # grey, as asphalt is and grass is not


def test_every_zoom_has_its_tiles(tiles: Tiles) -> None:
    assert {tile.zoom for tile in tiles} == set(range(ZOOM_LEAST, ZOOM_MOST + 1))
    assert {one.size for one in tiles.values()} == {(256, 256)}


def test_pictures_are_written_as_the_service_asks_for_them(west: AerialPicture, tmp_path: Path) -> None:
    (found,) = write_pictures([west], tmp_path)
    names = [path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.webp")]
    assert f"image-0-0/{ZOOM_MOST}/{west.column + 1}/{west.row + 1}.webp" in names
    assert found == PictureFolder(image="image-0-0", folder=tmp_path / "image-0-0", bounds=west.bounds)


def test_the_configuration_names_every_picture(tmp_path: Path) -> None:
    one = PictureFolder(image='a "b"', folder=tmp_path / "a", bounds=(151.0, -34.0, 151.5, -33.5))
    (raster,) = tomllib.loads(viewer_configuration([one], tmp_path))["web"]["rasters"]
    assert (raster["images"], raster["bounds"], raster["ending"]) == (['a "b"'], [151.0, -34.0, 151.5, -33.5], "webp")
