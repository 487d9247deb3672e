"""How QGIS draws a layer by the style its file has, as JSON on standard output; run by the system's Python.

Arguments: the layer's source, and a picture to draw. Of each feature: its category's label, and the box around what the
category's symbol generates, in the layer's CRS.
"""

import json
import sys
from typing import Any

from qgis.core import (
    QgsApplication,
    QgsExpression,
    QgsExpressionContext,
    QgsExpressionContextUtils,
    QgsGeometryGeneratorSymbolLayer,
    QgsMapRendererParallelJob,
    QgsMapSettings,
    QgsVectorLayer,
)
from qgis.PyQt.QtCore import QSize
from qgis.PyQt.QtGui import QColor


def main(source: str, picture: str) -> None:
    application = QgsApplication([], False)
    application.initQgis()
    layer = QgsVectorLayer(source, "styled", "ogr")
    draw(layer, picture)
    sys.stdout.write(json.dumps([described(layer, feature) for feature in layer.getFeatures()]) + "\n")
    del layer
    application.exitQgis()


def described(layer: Any, feature: Any) -> dict[str, Any]:
    context = QgsExpressionContext(QgsExpressionContextUtils.globalProjectLayerScopes(layer))
    context.setFeature(feature)
    value = evaluated(layer.renderer().classAttribute(), context)
    category = layer.renderer().categories()[layer.renderer().categoryIndexForValue(value)]
    boxes = [
        evaluated(one.geometryExpression(), context).boundingBox()
        for one in category.symbol().symbolLayers()
        if isinstance(one, QgsGeometryGeneratorSymbolLayer)
    ]
    sides = [[box.xMinimum(), box.yMinimum(), box.xMaximum(), box.yMaximum()] for box in boxes]
    return {"category": category.label(), "generated_m": sides}


def evaluated(text: str, context: Any) -> Any:
    asked = QgsExpression(text)
    found = asked.evaluate(context)
    assert not asked.hasParserError(), asked.parserErrorString()
    assert not asked.hasEvalError(), asked.evalErrorString()
    return found


def draw(layer: Any, picture: str) -> None:
    settings = QgsMapSettings()
    settings.setLayers([layer])
    settings.setDestinationCrs(layer.crs())
    settings.setExtent(layer.extent().buffered(30.0))
    settings.setOutputSize(QSize(900, 300))
    settings.setBackgroundColor(QColor("white"))
    job = QgsMapRendererParallelJob(settings)
    job.start()
    job.waitForFinished()
    assert job.renderedImage().save(picture)


if __name__ == "__main__":
    main(*sys.argv[1:])
