"""The ortho layer's files in programs that read them: how far bright marks are from a layer of points."""

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

from figures.figure import Figure, Measurement, at_most
from figures.workbench import CommandFailed, Workbench
from qgis_reading.project import is_installed
from raster_readers.in_files import (
    archive_in_python,
    cog_in_gdal,
    cog_in_rasterio,
    pictures_in_gdal,
    warped_cog_in_gdal,
)
from raster_readers.in_maplibre import MapPage, map_page
from raster_readers.in_qgis import cog_in_qgis, pictures_in_qgis
from raster_readers.marks import MarkedLayer, marked_layer
from viewed_maps.browser import chromium, missing

COMMAND = "trigpoint ortho render --resolution-m 0.2  # raster_readers: nine marks of 1 m radius"
HALF_PX = 0.5
ZOOMS_OUT = 2
Read = Callable[[MarkedLayer], float]


@cache
def layer_in(folder: Path) -> MarkedLayer:
    """The layer, rendered once."""
    return marked_layer(folder / "marked")


def of_reader(bench: Workbench, *, read: Read) -> Measurement:
    """How far off the worst mark is for a reader."""
    try:
        return Measurement(value=read(layer_in(bench.folder)), command=COMMAND)
    except AssertionError as error:
        raise CommandFailed(f"{COMMAND}: {error}") from error


def in_qgis(layer: MarkedLayer, *, read: Read) -> float:
    """A reading by QGIS. Raises CommandFailed where that is not installed."""
    if not is_installed():
        raise CommandFailed("python3-qgis is not installed")
    return read(layer)


def in_maplibre(layer: MarkedLayer, *, look: Callable[[MapPage], float]) -> float:
    """A look by MapLibre. Raises CommandFailed where the browser or the viewer's packages are missing."""
    if missing():
        raise CommandFailed(missing())
    with chromium() as browser, map_page(browser, layer) as page:
        return look(page)


def _figure(name: str, read: Read) -> Figure:
    return Figure(
        name=f"marks off their points, worst of nine: {name}",
        unit="px",
        target=at_most(HALF_PX),
        measure=partial(of_reader, read=read),
    )


FIGURES = (
    _figure("COG in rasterio", cog_in_rasterio),
    _figure("COG in GDAL's programs", cog_in_gdal),
    _figure("COG brought to EPSG:3857 by gdalwarp", warped_cog_in_gdal),
    _figure("XYZ in GDAL's programs", pictures_in_gdal),
    _figure("PMTiles in its Python reader", lambda layer: archive_in_python(layer, zoom=layer.zoom)),
    _figure("COG in QGIS", partial(in_qgis, read=cog_in_qgis)),
    _figure("XYZ in QGIS", partial(in_qgis, read=pictures_in_qgis)),
    _figure("XYZ in MapLibre", partial(in_maplibre, look=lambda page: page.pictures_off_px(page.layer.zoom))),
    _figure(
        "XYZ in MapLibre, two zooms farther out",
        partial(in_maplibre, look=lambda page: page.pictures_off_px(page.layer.zoom - ZOOMS_OUT)),
    ),
    _figure("PMTiles in MapLibre", partial(in_maplibre, look=MapPage.archive_off_px)),
)
