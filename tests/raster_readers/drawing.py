"""What QGIS draws of rasters and of points, as pictures; run by the system's Python, which has QGIS' own package.

Argument: a JSON object with `crs`, `box` (west, south, east, north in it), `size_px` (columns, rows), `points` (a
file), `rasters` (name: provider and source) and `folder`. Written there: NAME.png for each raster, points.png.
"""

import json
import sys
from pathlib import Path
from typing import Any

from qgis.core import (
    QgsApplication,
    QgsContrastEnhancement,
    QgsCoordinateReferenceSystem,
    QgsMapRendererSequentialJob,
    QgsMapSettings,
    QgsMarkerSymbol,
    QgsProject,
    QgsRasterLayer,
    QgsRectangle,
    QgsSingleBandGrayRenderer,
    QgsSingleSymbolRenderer,
    QgsVectorLayer,
)
from qgis.PyQt.QtCore import QSize
from qgis.PyQt.QtGui import QColor

BRIGHTEST = 12.0  # of the reflectivity, where a usual ground has 1
POINT = {"name": "circle", "color": "white", "outline_style": "no", "size": "12", "size_unit": "Pixel"}


def main(asked: dict[str, Any]) -> None:
    application = QgsApplication([], False)
    application.initQgis()
    draw_all(asked)  # its layers are gone before the application is
    application.exitQgis()


def draw_all(asked: dict[str, Any]) -> None:
    points = QgsVectorLayer(asked["points"], "points", "ogr")
    assert points.isValid(), asked["points"]
    points.setRenderer(QgsSingleSymbolRenderer(QgsMarkerSymbol.createSimple(POINT)))
    draw(points, "points", asked)
    for name, (provider, source) in asked["rasters"].items():
        raster = QgsRasterLayer(source, name, provider)
        assert raster.isValid(), raster.error().summary()
        if provider == "gdal":
            raster.setRenderer(first_band(raster))
        draw(raster, name, asked)


def first_band(raster: Any) -> Any:
    """A raster's first band in grey, from nothing to the brightest."""
    renderer = QgsSingleBandGrayRenderer(raster.dataProvider(), 1)
    enhancement = QgsContrastEnhancement(raster.dataProvider().dataType(1))
    enhancement.setMinimumValue(0.0)
    enhancement.setMaximumValue(BRIGHTEST)
    enhancement.setContrastEnhancementAlgorithm(QgsContrastEnhancement.StretchToMinimumMaximum)
    renderer.setContrastEnhancement(enhancement)
    return renderer


def draw(layer: Any, name: str, asked: dict[str, Any]) -> None:
    settings = QgsMapSettings()
    settings.setLayers([layer])
    settings.setDestinationCrs(QgsCoordinateReferenceSystem(asked["crs"]))
    settings.setTransformContext(QgsProject.instance().transformContext())
    settings.setExtent(QgsRectangle(*asked["box"]))
    settings.setOutputSize(QSize(*asked["size_px"]))
    settings.setBackgroundColor(QColor("black"))
    job = QgsMapRendererSequentialJob(settings)
    job.start()
    job.waitForFinished()
    assert not job.errors(), [error.message for error in job.errors()]
    assert job.renderedImage().save(str(Path(asked["folder"]) / f"{name}.png"))


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
