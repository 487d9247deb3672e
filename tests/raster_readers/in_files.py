"""The layer as rasterio and as GDAL's own programs read it."""

import subprocess
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from numpy.typing import NDArray
from PIL import Image
from pmtiles.reader import MmapSource, Reader
from rasterio.warp import transform

from raster_readers.marks import MARK_RADIUS_M, PIXEL_M, MarkedLayer, marks_deg
from raster_readers.misfit import worst_px

Floats = NDArray[np.float64]

WINDOW_M = 2.0 * MARK_RADIUS_M
TILE_PX = 256
HALF_M = 20_037_508.342789244  # of the web's world
WEB_SCALE_M = 1.21  # a metre of ground where the marks are, in metres of EPSG:3857
TILES = """<GDAL_WMS>
<Service name="TMS"><ServerUrl>file://{folder}/${{z}}/${{x}}/${{y}}.png</ServerUrl></Service>
<DataWindow><UpperLeftX>-{half}</UpperLeftX><UpperLeftY>{half}</UpperLeftY>
<LowerRightX>{half}</LowerRightX><LowerRightY>-{half}</LowerRightY>
<TileLevel>{zoom}</TileLevel><TileCountX>1</TileCountX><TileCountY>1</TileCountY><YOrigin>top</YOrigin></DataWindow>
<Projection>EPSG:3857</Projection><BlockSizeX>256</BlockSizeX><BlockSizeY>256</BlockSizeY><BandsCount>2</BandsCount>
<ZeroBlockHttpCodes>204,404</ZeroBlockHttpCodes>
</GDAL_WMS>
"""


def web_pixel_m(zoom: int) -> float:
    """The side of a web tile's pixel in metres of EPSG:3857."""
    return 2.0 * HALF_M / (TILE_PX << zoom)


def web_radius_px(zoom: int) -> float:
    """The radius around a mark in which it is looked for, in pixels of web tiles."""
    return WINDOW_M * WEB_SCALE_M / web_pixel_m(zoom)


def cog_in_rasterio(layer: MarkedLayer) -> float:
    """How far the worst mark is from its place in the COG, in its pixels."""
    with rasterio.open(layer.cog) as raster:
        band = raster.read(1).astype(np.float64)
        x_m, y_m = transform("EPSG:4326", raster.crs, *marks_deg().T)
        places = np.column_stack(~raster.transform * (np.asarray(x_m), np.asarray(y_m)))
    return worst_px(band, places, radius_px=WINDOW_M / PIXEL_M)


def archive_in_python(layer: MarkedLayer, *, zoom: int) -> float:
    """The same of the tiles of a zoom in the PMTiles archive, as its reference reader finds them."""
    x_m, y_m = (np.asarray(one) for one in transform("EPSG:4326", "EPSG:3857", *marks_deg().T))
    pixel_m = web_pixel_m(zoom)
    places = np.column_stack([(x_m + HALF_M) / pixel_m, (HALF_M - y_m) / pixel_m])
    first = np.floor(places.min(axis=0) / TILE_PX).astype(int)
    last = np.floor(places.max(axis=0) / TILE_PX).astype(int)
    with layer.archive.open("rb") as file:
        archive: Any = Reader(MmapSource(file))  # type: ignore[no-untyped-call]
        whole = np.vstack(
            [
                np.hstack([_tile(archive.get(zoom, column, row)) for column in range(first[0], last[0] + 1)])
                for row in range(first[1], last[1] + 1)
            ]
        )
    return worst_px(whole, places - first * TILE_PX, radius_px=web_radius_px(zoom))


def _tile(content: bytes | None) -> Floats:
    if content is None:
        return np.full((TILE_PX, TILE_PX), np.nan)
    with Image.open(BytesIO(content)) as picture:
        grey, alpha = np.moveaxis(np.asarray(picture, dtype=np.float64), -1, 0)
    return np.where(alpha > 0.0, grey, np.nan)


def cog_in_gdal(layer: MarkedLayer) -> float:
    """How far the worst mark is from its place in the COG as GDAL's programs have it, in its pixels."""
    return _worst_in_gdal(layer.cog, layer.folder / "cog", radius_px=WINDOW_M / PIXEL_M)


def warped_cog_in_gdal(layer: MarkedLayer) -> float:
    """The same of the COG warped to EPSG:3857 by gdalwarp, in pixels as large as the finest web tiles'."""
    warped, pixel_m = layer.folder / "warped.tif", str(web_pixel_m(layer.zoom))
    _said("gdalwarp", "-q", "-overwrite", "-t_srs", "EPSG:3857", "-tr", pixel_m, pixel_m, layer.cog, warped)
    return _worst_in_gdal(warped, layer.folder / "warped", radius_px=web_radius_px(layer.zoom))


def pictures_in_gdal(layer: MarkedLayer) -> float:
    """The same of the folder of XYZ tiles, read by GDAL's driver for tile services."""
    service, cut = layer.folder / "tiles.xml", layer.folder / "tiles.tif"
    service.write_text(TILES.format(folder=layer.pictures, half=HALF_M, zoom=layer.zoom), encoding="utf-8")
    x_m, y_m = (np.asarray(one) for one in transform("EPSG:4326", "EPSG:3857", *marks_deg().T))
    margin_m = 2.0 * WINDOW_M
    box = (x_m.min() - margin_m, y_m.max() + margin_m, x_m.max() + margin_m, y_m.min() - margin_m)
    _said("gdal_translate", "-q", "-projwin", *(f"{edge:.6f}" for edge in box), service, cut)
    return _worst_in_gdal(cut, layer.folder / "tiles", radius_px=web_radius_px(layer.zoom))


def _worst_in_gdal(dataset: Path, raw: Path, *, radius_px: float) -> float:
    """By its programs alone: pixels as gdal_translate writes them bare, places as gdaltransform computes them."""
    _said("gdal_translate", "-q", "-of", "ENVI", "-ot", "Float32", "-b", "1", dataset, raw)
    header = _header(raw.with_suffix(".hdr"))
    shape = int(header["lines"]), int(header["samples"])
    band = np.fromfile(raw, dtype="<f4").reshape(shape).astype(np.float64)
    lines = "".join(f"{lon_deg:.12f} {lat_deg:.12f}\n" for lon_deg, lat_deg in marks_deg())
    said = _said("gdaltransform", "-i", "-t_srs", "EPSG:4326", dataset, told=lines)
    places = np.array([line.split()[:2] for line in said.splitlines()], dtype=np.float64)
    return worst_px(band, places, radius_px=radius_px)


def _said(*words: str | Path, told: str | None = None) -> str:
    done = subprocess.run([str(word) for word in words], input=told, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def _header(path: Path) -> dict[str, str]:
    """The values of an ENVI header that stand on a line of their own."""
    pairs = (line.partition("=") for line in path.read_text(encoding="utf-8").splitlines())
    return {name.strip(): value.strip() for name, equals, value in pairs if equals}
