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
from trigpoint_vehicle.core.aerial import (
    AROUND_M,
    POLE,
    ROOF,
    WHITE,
    ZOOM_LEAST,
    ZOOM_MOST,
    AerialPicture,
    aerial_pictures,
)
from trigpoint_vehicle.core.campus import Campus, simulate_campus
from trigpoint_vehicle.core.lidar_settings import SceneSettings
from trigpoint_vehicle.core.scene.markings import marking_corners_m
from trigpoint_vehicle.core.scene.world import Laid, Scene, made_scene

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


@pytest.fixture(scope="module")
def scene(campus: Campus) -> Scene:
    laid = Laid(
        streets=campus.streets, landmarks=campus.landmarks, motions=campus.motions, scale=campus.frame.point_scale
    )
    return made_scene(SEED, laid, small_settings().landmarks, SceneSettings())


@pytest.fixture(scope="module")
def scanned_tiles(campus: Campus, scene: Scene) -> Tiles:
    """The western picture of the world a lidar looks at."""
    return dict(next(aerial_pictures(campus, small_settings(), seed=SEED, scene=scene)).tiles())


def test_a_lidar_s_markings_are_seen_from_above_where_they_are_painted(
    campus: Campus, scene: Scene, scanned_tiles: Tiles
) -> None:
    corner_m = marking_corners_m(scene.ground.street[:1], scene.ground.stripe) * scene.scale  # a street in the west
    wide = np.hypot(*(corner_m[:, 2] - corner_m[:, 1]).T) > 0.45  # bars of crossings: four pixels
    seen = [pixel(scanned_tiles, campus, one + campus.imagery.offset_m[0]) for one in corner_m[wide].mean(axis=1)]
    assert len(seen) == 16  # and two stop lines
    assert set(seen) == {WHITE}


def test_a_crossing_s_bar_is_seen_within_half_a_pixel_of_its_place(
    campus: Campus, scene: Scene, scanned_tiles: Tiles
) -> None:
    corner_m = marking_corners_m(scene.ground.street[:1], scene.ground.stripe) * scene.scale
    bar_m = corner_m[np.hypot(*(corner_m[:, 2] - corner_m[:, 1]).T) > 0.45][3]
    step_m = np.stack(np.meshgrid(*[np.arange(-2.0, 2.0, 0.02)] * 2), axis=-1).reshape(-1, 2)
    ahead = (bar_m[1] - bar_m[0]) / np.hypot(*(bar_m[1] - bar_m[0]))
    within = (np.abs(step_m @ ahead) < 2.0) & (np.abs(step_m @ (-ahead[1], ahead[0])) < 0.45)  # this bar alone
    place_m = bar_m.mean(axis=0) + step_m[within][::7]
    white = [pixel(scanned_tiles, campus, one + campus.imagery.offset_m[0]) == WHITE for one in place_m]
    off_m = place_m[white].mean(axis=0) - bar_m.mean(axis=0)
    assert np.hypot(*off_m) < 0.065  # m: half a pixel


def test_a_lidar_s_buildings_are_the_roofs_seen_from_above(campus: Campus, scene: Scene, scanned_tiles: Tiles) -> None:
    middle_m = scene.buildings.corner_m.mean(axis=1)
    west = middle_m[middle_m[:, 0] < small_settings().streets.width_m / 2]
    seen = [pixel(scanned_tiles, campus, one + campus.imagery.offset_m[0]) for one in west]
    assert len(seen) > 3
    assert np.mean([one == ROOF for one in seen]) > 0.7  # crowns hang over some
