"""Web tiles as one raster: GDAL's own description of a mosaic (VRT)."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, tostring

from trigpoint.errors import InputError
from trigpoint.geodesy.web_tiles import WebTile
from trigpoint_tiles.core.grid import RasterGrid, Tile, TileBox, box_of, web_mercator_zoom

COLOURS = ("Red", "Green", "Blue")
OPAQUE = "255"
PIXELS_MOST = 1 << 31  # GDAL's limit of a raster's side


@dataclass(frozen=True, slots=True, kw_only=True)
class TileFile:
    """A tile's file by its absolute path: its pixels a side, how many colours it has, 1 or 3, and whether alpha stands
    behind them."""

    path: str
    side_px: int
    colours: int
    alpha: bool


def mosaic_vrt(tiles: Mapping[WebTile, TileFile]) -> str:
    """Tiles of one zoom of WebMercatorQuad, one at least and all of one size, as a VRT of three colours and alpha:
    clear where there is no tile. Raises InputError for tiles of several sizes and for a mosaic larger than GDAL reads.
    """
    first, form = next(iter(tiles.items()))
    box = box_of([Tile(one.column, one.row) for one in tiles])
    if odd := next((one for one in tiles.values() if one.side_px != form.side_px), None):
        raise InputError(f"{odd.path}: {odd.side_px} pixels a side: {form.path} has {form.side_px}")
    if max(box.columns, box.rows) * form.side_px >= PIXELS_MOST:
        raise InputError(f"{box.columns} x {box.rows} tiles of {form.side_px} pixels are larger than GDAL reads")
    root = _dataset(web_mercator_zoom(first.zoom), box, side_px=form.side_px)
    for number, colour in enumerate((*COLOURS, "Alpha"), start=1):
        band = SubElement(root, "VRTRasterBand", dataType="Byte", band=str(number))
        SubElement(band, "ColorInterp").text = colour
        for tile, file in tiles.items():
            band.append(_source(file, number, at=(tile.column - box.column, tile.row - box.row)))
    return tostring(root, encoding="unicode")


def finest(tiles: Iterable[WebTile]) -> tuple[WebTile, ...]:
    """The tiles of the highest zoom there is, by row and column; none of none."""
    every = tuple(tiles)
    zoom = max((one.zoom for one in every), default=0)
    return tuple(sorted((one for one in every if one.zoom == zoom), key=lambda one: (one.row, one.column)))


def _dataset(grid: RasterGrid, box: TileBox, *, side_px: int) -> Element:
    west_m, _, east_m, north_m = grid.bounds_m(box)
    size = {"rasterXSize": str(box.columns * side_px), "rasterYSize": str(box.rows * side_px)}
    root = Element("VRTDataset", size)
    pixel_m = (east_m - west_m) / (box.columns * side_px)
    SubElement(root, "SRS").text = grid.crs
    placed = (west_m, pixel_m, 0.0, north_m, 0.0, -pixel_m)
    SubElement(root, "GeoTransform").text = ", ".join(repr(float(one)) for one in placed)
    return root


def _source(file: TileFile, number: int, *, at: tuple[int, int]) -> Element:
    """A tile as the source of one band: a grey one of every colour; one without alpha is opaque."""
    of_alpha = number > len(COLOURS)
    opaque = of_alpha and not file.alpha
    source = Element("ComplexSource" if opaque else "SimpleSource")
    SubElement(source, "SourceFilename", relativeToVRT="0").text = file.path
    band = 1 if opaque else file.colours + 1 if of_alpha else min(number, file.colours)
    SubElement(source, "SourceBand").text = str(band)
    side = str(file.side_px)
    known = {"RasterXSize": side, "RasterYSize": side, "DataType": "Byte", "BlockXSize": side, "BlockYSize": "1"}
    SubElement(source, "SourceProperties", known)
    SubElement(source, "SrcRect", xOff="0", yOff="0", xSize=side, ySize=side)
    column, row = (str(place * file.side_px) for place in at)
    SubElement(source, "DstRect", xOff=column, yOff=row, xSize=side, ySize=side)
    if opaque:
        SubElement(source, "ScaleOffset").text = OPAQUE
        SubElement(source, "ScaleRatio").text = "0"
    return source
