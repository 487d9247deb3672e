"""Drives over painted ground as files: where they lie, who reads them, and what a new map version changes."""

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from numpy.typing import NDArray
from pmtiles.reader import MmapSource, Reader
from pmtiles.tile import zxy_to_tileid

from scanned_drives.examples import (
    BRIGHT,
    DARK,
    FRAME,
    STRIPE_M,
    arc,
    drive_rows,
    scanned_log,
    solved_path,
)
from scanned_drives.moved_street import (
    OTHER_STREET,
    STREET,
    bent_street,
    rendered_anew,
    smooth_ground,
    two_versions,
    whole_street,
)
from trigpoint.errors import InputError
from trigpoint.geodesy.projection import transform_coordinates
from trigpoint.geodesy.web_tiles import WebTile
from trigpoint.logs.memory_log import MemoryLog
from trigpoint_tiles.app import Rendered, render_ortho
from trigpoint_tiles.picture_files import PictureFolder
from trigpoint_tiles.settings import TilesSettings

SETTINGS = TilesSettings(resolution_m=0.2, memory_bytes=512 * 1024**2, attribution="Simulated", zooms=3)
POSES = arc(5.0)


def one_drive() -> MemoryLog:
    return scanned_log({"car": drive_rows("car", POSES)}, [solved_path("car", POSES)])


@pytest.fixture(scope="module")
def layer(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Rendered]:
    """The files of one drive."""
    out = tmp_path_factory.mktemp("layer")
    return out, render_ortho(one_drive(), out, settings=SETTINGS)


def painted(point_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """How bright the ground is at map positions (n, 2)."""
    return np.where(np.floor(point_m / STRIPE_M).sum(axis=1) % 2 == 0, DARK, BRIGHT)


def misfit(
    band: NDArray[np.float64], left_m: float, top_m: float, pixel_m: float, off_px: tuple[float, float]
) -> float:
    """How much of the painted ground a band shows in the other colour, if it lay so many pixels east and north."""
    row, column = np.nonzero(np.isfinite(band))
    east_m = left_m + (column + 0.5 - off_px[0]) * pixel_m - FRAME.origin_easting_m
    north_m = top_m - (row + 0.5 + off_px[1]) * pixel_m - FRAME.origin_northing_m
    expected = painted(np.column_stack([east_m, north_m])) > (DARK + BRIGHT) / 2
    shown = band[row, column]
    return float((expected != (shown > np.nanmean(band))).mean())


def test_the_cog_lies_on_a_reference_layer_to_within_half_a_pixel(layer: tuple[Path, Rendered]) -> None:
    with rasterio.open(layer[0] / "ortho.tif") as raster:
        band, left_m, top_m = raster.read(1).astype(float), raster.transform.c, raster.transform.f
    offsets = np.arange(-2.0, 2.1, 0.25)
    found = {(e, n): misfit(band, left_m, top_m, 0.2, (e, n)) for e in offsets for n in offsets}
    best = min(found, key=lambda off: found[off])
    assert max(abs(best[0]), abs(best[1])) <= 0.5
    assert found[best] < 0.12  # a fifth of the pixels lie on a stripe's edge


def test_the_cog_says_what_it_is_and_gdal_finds_nothing_to_complain_of(layer: tuple[Path, Rendered]) -> None:
    path = layer[0] / "ortho.tif"
    with rasterio.open(path) as raster:
        assert raster.crs.to_epsg() == 32756
        assert raster.descriptions == ("reflectivity", "ground_height", "height_above", "density", "sigma")
        assert raster.overviews(1) != []
        assert raster.tags()["MAP_VERSION"] == "1"
        assert raster.tags()["ATTRIBUTION"] == "Simulated"
        assert raster.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"


def test_gdals_own_programs_read_the_cog(layer: tuple[Path, Rendered], tmp_path: Path) -> None:
    path, part = str(layer[0] / "ortho.tif"), str(tmp_path / "part.tif")
    said = subprocess.run(["gdalinfo", "-json", path], capture_output=True, text=True, check=True)
    assert json.loads(said.stdout)["bands"][0]["description"] == "reflectivity"
    subprocess.run(["gdal_translate", "-srcwin", "0", "0", "64", "64", path, part], capture_output=True, check=True)
    with rasterio.open(part) as small, rasterio.open(path) as whole:
        assert np.array_equal(small.read(4), whole.read(4)[:64, :64], equal_nan=True)


def test_sigma_comes_from_the_path_and_the_range(layer: tuple[Path, Rendered]) -> None:
    with rasterio.open(layer[0] / "ortho.tif") as raster:
        sigma_m = raster.read(5)
    # The path's 0.1 m and the lidar's 0.03 m, and 0.001 rad over at most 38 m.
    assert 0.104 <= float(np.nanmin(sigma_m)) < float(np.nanmax(sigma_m)) <= 0.112


def test_the_archive_and_the_folder_hold_the_same_pictures(layer: tuple[Path, Rendered]) -> None:
    pictures = PictureFolder(layer[0] / "xyz")
    with (layer[0] / "ortho.pmtiles").open("rb") as file:
        archive: Any = Reader(MmapSource(file))  # type: ignore[no-untyped-call]
        header = archive.header()
        tiles = list(pictures.tiles())
        assert {tile.zoom for tile in tiles} == set(range(header["min_zoom"], header["max_zoom"] + 1))
        assert all(archive.get(tile.zoom, tile.column, tile.row) == pictures.path(tile).read_bytes() for tile in tiles)
        assert header["addressed_tiles_count"] == len(tiles)
        assert zxy_to_tileid(tiles[0].zoom, tiles[0].column, tiles[0].row) >= 0
        assert archive.metadata()["attribution"] == "Simulated"


def test_a_web_tile_shows_the_ground_where_web_mercator_has_it(layer: tuple[Path, Rendered]) -> None:
    (grid,) = [one for one in layer[1].grids if one.zoom is not None]
    pictures, wrong, total = PictureFolder(layer[0] / "xyz"), 0, 0
    for tile in sorted(grid.brought_up.tiles):
        shown = pictures.read(WebTile(grid.zoom or 0, tile.column, tile.row))
        if shown is None:
            continue
        row, column = np.nonzero(shown[..., 1])
        half_m = 20_037_508.342789244
        x_m = (tile.column * 256 + column + 0.5) * grid.pixel_m - half_m
        y_m = half_m - (tile.row * 256 + row + 0.5) * grid.pixel_m
        east_m, north_m = transform_coordinates(
            np.asarray(x_m, float), np.asarray(y_m, float), source_crs="EPSG:3857", target_crs=FRAME.crs
        )
        expected = painted(np.column_stack([east_m - FRAME.origin_easting_m, north_m - FRAME.origin_northing_m]))
        wrong += int(((expected > 50.0) != (shown[row, column, 0] > 128)).sum())
        total += len(row)
    assert total > 10_000
    assert wrong < 0.12 * total


def test_the_viewers_section_names_the_folder_and_its_zooms(layer: tuple[Path, Rendered]) -> None:
    text = (layer[0] / "rasters.toml").read_text(encoding="utf-8")
    assert 'kind = "ortho"' in text
    assert str(layer[0] / "xyz") in text


def bands_of(path: Path) -> NDArray[np.float32]:
    with rasterio.open(path) as raster:
        return np.asarray(raster.read())


def pictures_of(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*.png")}


def two_drives() -> tuple[MemoryLog, MemoryLog]:
    """Two drives far apart, and the same with a second map version that has moved the second one's path."""
    return two_versions(OTHER_STREET, whole_street())


def test_a_map_version_renders_only_what_moved_and_the_same_as_a_full_render(tmp_path: Path) -> None:
    first, second = two_drives()
    render_ortho(first, tmp_path / "kept", settings=SETTINGS)
    found = render_ortho(second, tmp_path / "kept", settings=SETTINGS)
    whole = render_ortho(second, tmp_path / "whole", settings=SETTINGS)
    for now, full in zip(found.grids, whole.grids, strict=True):
        assert now.brought_up.counts["car/b"].used == 0
        assert 0 < len(now.brought_up.rendered) < len(full.brought_up.rendered)
    assert np.array_equal(bands_of(tmp_path / "kept/ortho.tif"), bands_of(tmp_path / "whole/ortho.tif"), equal_nan=True)
    assert pictures_of(tmp_path / "kept/xyz") == pictures_of(tmp_path / "whole/xyz")


def test_where_a_streets_middle_moved_its_tiles_alone_are_rendered_and_all_equal_a_full_render(tmp_path: Path) -> None:
    found = rendered_anew(tmp_path, STREET, bent_street(), world=smooth_ground)
    assert 0 < found.touched < found.tiles
    assert found.equal == found.tiles


def test_the_same_version_again_renders_nothing(tmp_path: Path) -> None:
    log = one_drive()
    render_ortho(log, tmp_path, settings=SETTINGS)
    again = render_ortho(log, tmp_path, settings=SETTINGS)
    assert [len(grid.brought_up.rendered) for grid in again.grids] == [0, 0]


def test_a_run_that_was_cut_off_leaves_the_old_files_and_the_next_one_is_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = two_drives()
    render_ortho(first, tmp_path / "cut", settings=SETTINGS)
    old = (tmp_path / "cut/ortho.tif").read_bytes()

    def cut_off(*arguments: object, **options: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("trigpoint_tiles.geotiff.rasterio.shutil.copy", cut_off)
        with pytest.raises(KeyboardInterrupt):
            render_ortho(second, tmp_path / "cut", settings=SETTINGS)
    assert (tmp_path / "cut/ortho.tif").read_bytes() == old
    render_ortho(second, tmp_path / "cut", settings=SETTINGS)
    render_ortho(second, tmp_path / "whole", settings=SETTINGS)
    assert np.array_equal(bands_of(tmp_path / "cut/ortho.tif"), bands_of(tmp_path / "whole/ortho.tif"), equal_nan=True)
    assert pictures_of(tmp_path / "cut/xyz") == pictures_of(tmp_path / "whole/xyz")


def test_a_drive_without_a_path_and_sweeps_outside_one_are_counted_and_the_rest_is_there(tmp_path: Path) -> None:
    rows = {"car": drive_rows("car", POSES), "lost": drive_rows("lost", POSES[:6])}
    log = scanned_log(rows, [solved_path("car", POSES[:-10])])
    found = render_ortho(log, tmp_path, settings=SETTINGS, formats=("cog",))
    assert found.without_path == {"lost/b": 5}
    counts = found.grids[0].brought_up.counts["car/b"]
    assert (counts.used, counts.outside_path) == (len(POSES) - 11, 10)


def test_a_log_without_any_path_is_refused_naming_the_drives(tmp_path: Path) -> None:
    log = scanned_log({"lost": drive_rows("lost", POSES[:3])}, [solved_path("car", POSES)])
    with pytest.raises(InputError, match="no sweep of a lidar has a path in map version 1: those of lost/b have none"):
        render_ortho(log, tmp_path, settings=SETTINGS)
