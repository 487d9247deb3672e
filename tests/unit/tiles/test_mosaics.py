"""Web tiles in a folder are one georeferenced raster, and what is no such folder is refused by name."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from trigpoint.errors import InputError
from trigpoint.geodesy.web_tiles import WebTile
from trigpoint_tiles.core.grid import TileBox, web_mercator_zoom
from trigpoint_tiles.core.mosaics import TileFile, mosaic_vrt
from trigpoint_tiles.geotiff import RasterFile, RasterPlace

ZOOM, COLUMN, ROW, SIDE = 18, 1000, 2000, 256
GRID = web_mercator_zoom(ZOOM)


def write(folder: Path, tile: WebTile, mode: str, colour: int | tuple[int, ...]) -> None:
    path = folder / str(tile.zoom) / str(tile.column) / f"{tile.row}.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new(mode, (SIDE, SIDE), colour).save(path)


def place(columns: int) -> RasterPlace:
    west, _, _, north = GRID.bounds_m(TileBox(column=COLUMN, row=ROW, columns=columns, rows=1))
    return RasterPlace(crs=GRID.crs, left_m=west, top_m=north, pixel_m=GRID.pixel_m, columns=columns * SIDE, rows=SIDE)


def test_tiles_lie_side_by_side_whatever_their_colours_and_only_the_finest_zoom_is_read(tmp_path: Path) -> None:
    write(tmp_path, WebTile(ZOOM, COLUMN, ROW), "RGB", (10, 20, 30))
    write(tmp_path, WebTile(ZOOM, COLUMN + 2, ROW), "LA", (40, 255))
    write(tmp_path, WebTile(ZOOM - 1, COLUMN // 2, ROW // 2), "RGB", (99, 99, 99))
    raster = RasterFile(tmp_path)
    found = raster.read_on(place(3), raster.colours, mean=False)
    raster.close()
    assert found[:, 100, 100].tolist() == [10, 20, 30]
    assert np.isnan(found[:, 100, SIDE + 100]).all()
    assert found[:, 100, 2 * SIDE + 100].tolist() == [40, 40, 40]


def test_what_is_clear_in_a_tile_was_not_seen(tmp_path: Path) -> None:
    write(tmp_path, WebTile(ZOOM, COLUMN, ROW), "RGBA", (10, 20, 30, 0))
    raster = RasterFile(tmp_path)
    found = raster.read_on(place(1), raster.colours, mean=False)
    raster.close()
    assert np.isnan(found).all()


def test_a_folder_without_tiles_is_refused_with_what_it_should_hold(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("nothing", encoding="utf-8")
    with pytest.raises(InputError, match=r"no tiles here: .*\{z\}/\{x\}/\{y\}\.png"):
        RasterFile(tmp_path)


def test_a_tile_that_is_no_picture_is_refused_by_name(tmp_path: Path) -> None:
    write(tmp_path, WebTile(ZOOM, COLUMN, ROW), "L", 1)
    (tmp_path / str(ZOOM) / str(COLUMN) / f"{ROW}.png").write_bytes(b"nothing")
    with pytest.raises(InputError, match=f"{ROW}.png: no picture can be read here"):
        RasterFile(tmp_path)


def test_tiles_of_two_sizes_are_refused_with_both() -> None:
    two = {
        WebTile(ZOOM, COLUMN + number, ROW): TileFile(path=f"/{side}.png", side_px=side, colours=3, alpha=False)
        for number, side in enumerate((256, 512))
    }
    with pytest.raises(InputError, match=r"/512.png: 512 pixels a side: /256.png has 256"):
        mosaic_vrt(two)


def test_a_picture_without_a_crs_is_refused_by_name(tmp_path: Path) -> None:
    write(tmp_path, WebTile(ZOOM, COLUMN, ROW), "RGB", (10, 20, 30))
    with pytest.raises(InputError, match=f"{ROW}.png: the image has no CRS"):
        RasterFile(tmp_path / str(ZOOM) / str(COLUMN) / f"{ROW}.png")
