"""The layer in the programs people look at it with: each shows bright marks where a layer of points has them."""

from collections.abc import Iterator

import pytest

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
from viewed_maps.browser import chromium

HALF_PX = 0.5


@pytest.fixture(scope="module")
def layer(tmp_path_factory: pytest.TempPathFactory) -> MarkedLayer:
    return marked_layer(tmp_path_factory.mktemp("marked"))


@pytest.fixture(scope="module")
def page(layer: MarkedLayer, viewer_built: None) -> Iterator[MapPage]:
    with chromium() as browser, map_page(browser, layer) as found:
        yield found


def test_rasterio_has_the_marks_in_the_cog_where_they_are(layer: MarkedLayer) -> None:
    assert cog_in_rasterio(layer) <= HALF_PX


@pytest.mark.parametrize("zooms_out", [0, 2])
def test_the_archives_tiles_have_them_from_near_and_far(layer: MarkedLayer, zooms_out: int) -> None:
    assert archive_in_python(layer, zoom=layer.zoom - zooms_out) <= HALF_PX


def test_gdals_programs_have_them_in_the_cog(layer: MarkedLayer) -> None:
    assert cog_in_gdal(layer) <= HALF_PX


def test_gdalwarp_brings_them_where_they_are_in_another_crs(layer: MarkedLayer) -> None:
    assert warped_cog_in_gdal(layer) <= HALF_PX


def test_gdal_has_them_in_the_folder_of_tiles(layer: MarkedLayer) -> None:
    assert pictures_in_gdal(layer) <= HALF_PX


@pytest.mark.qgis
def test_qgis_draws_them_in_the_cog_on_their_points(layer: MarkedLayer) -> None:
    assert cog_in_qgis(layer) <= HALF_PX


@pytest.mark.qgis
def test_qgis_draws_them_in_the_folder_of_tiles_on_their_points(layer: MarkedLayer) -> None:
    assert pictures_in_qgis(layer) <= HALF_PX


@pytest.mark.browser
def test_maplibre_draws_them_in_the_folder_of_tiles_on_their_points(page: MapPage, layer: MarkedLayer) -> None:
    assert page.pictures_off_px(layer.zoom) <= HALF_PX


@pytest.mark.browser
def test_maplibre_draws_them_in_the_archive_on_their_points(page: MapPage) -> None:
    assert page.archive_off_px() <= HALF_PX
