"""What QGIS makes of a project, as JSON on standard output; run by the system's Python, which has QGIS' own package.

Arguments: the project, a picture to draw, and the picture's box (west,south,east,north in the project's CRS).
"""

import json
import sys
from typing import Any

from qgis.core import (
    QgsApplication,
    QgsCoordinateTransform,
    QgsExpression,
    QgsExpressionContext,
    QgsExpressionContextUtils,
    QgsMapRendererParallelJob,
    QgsMapSettings,
    QgsProject,
    QgsRectangle,
    QgsVectorLayer,
)
from qgis.PyQt.QtCore import QSize
from qgis.PyQt.QtGui import QColor

PICTURE_PX = QSize(900, 700)


def main(project_path: str, picture: str, box: str) -> None:
    application = QgsApplication([], False)
    application.initQgis()
    project = QgsProject.instance()
    read = project.read(project_path)
    layers = project.layerTreeRoot().layerOrder()
    said = {
        "read": read,
        "title": project.title(),
        "crs": project.crs().authid(),
        "layers": {layer.name(): described(layer, project) for layer in project.mapLayers().values()},
        "errors": drawn(layers, project, picture, [float(side) for side in box.split(",")]),
    }
    sys.stdout.write(json.dumps(said) + "\n")
    project.clear()
    application.exitQgis()


def described(layer: Any, project: Any) -> dict[str, Any]:
    said = {"valid": layer.isValid(), "crs": layer.crs().authid(), "renderer": type(layer.renderer()).__name__}
    if isinstance(layer, QgsVectorLayer):
        said["points_m"] = points_of(layer, project)
        said["features"] = len(said["points_m"])
        said["drawn_m"] = extents_of(layer, project)
    return said


def points_of(layer: Any, project: Any) -> dict[str, Any]:
    """The first point of each feature on the project's grid, by the feature's name."""
    onto_grid = QgsCoordinateTransform(layer.crs(), project.crs(), project)
    found = {}
    for feature in layer.getFeatures():
        name = ":".join(str(feature[key]) for key in names_of(layer))
        point = None
        if not feature.geometry().isNull():
            vertex = next(iter(list(feature.geometry().vertices())))
            moved = onto_grid.transform(vertex.x(), vertex.y())
            point = [moved.x(), moved.y()]
        found[name] = point
    return found


def names_of(layer: Any) -> list[str]:
    there = {field.name() for field in layer.fields()}
    options = (("landmark", "valid_from_version"), ("anchor", "image"), ("vehicle", "boot_id"), ("image",))
    chosen = next(names for names in options if set(names) <= there)
    return [name for name in chosen if name != "valid_from_version"]


def extents_of(layer: Any, project: Any) -> dict[str, Any]:
    """The area and the box's sides of what the style generates for each feature, on the project's grid."""
    expression = generator_of(layer)
    if not expression:
        return {}
    asked = QgsExpression(expression)
    assert not asked.hasParserError(), asked.parserErrorString()
    context = QgsExpressionContext()
    for scope in (
        QgsExpressionContextUtils.globalScope(),
        QgsExpressionContextUtils.projectScope(project),
        QgsExpressionContextUtils.layerScope(layer),
    ):
        context.appendScope(scope)
    asked.prepare(context)
    onto_grid = QgsCoordinateTransform(layer.crs(), project.crs(), project)
    found = {}
    for feature in layer.getFeatures():
        context.setFeature(feature)
        shape = asked.evaluate(context)
        assert not asked.hasEvalError(), asked.evalErrorString()
        if shape is None or not hasattr(shape, "transform"):
            continue
        shape.transform(onto_grid)
        around = shape.boundingBox()
        found[":".join(str(feature[key]) for key in names_of(layer))] = [
            around.xMinimum(),
            around.yMinimum(),
            around.xMaximum(),
            around.yMaximum(),
        ]
    return found


def generator_of(layer: Any) -> str:
    """The first geometry generator's expression of a layer's style, as its QML has it."""
    from qgis.PyQt.QtXml import QDomDocument

    document = QDomDocument()
    layer.exportNamedStyle(document)
    options = document.elementsByTagName("Option")
    for number in range(options.count()):
        element = options.at(number).toElement()
        if element.attribute("name") == "geometryModifier":
            return str(element.attribute("value"))
    return ""


def drawn(layers: Any, project: Any, picture: str, box: list[float]) -> list[str]:
    settings = QgsMapSettings()
    settings.setLayers(layers)
    settings.setDestinationCrs(project.crs())
    settings.setExtent(QgsRectangle(*box))
    settings.setOutputSize(PICTURE_PX)
    settings.setBackgroundColor(QColor("white"))
    context = QgsExpressionContext()
    context.appendScope(QgsExpressionContextUtils.globalScope())
    context.appendScope(QgsExpressionContextUtils.projectScope(project))
    settings.setExpressionContext(context)
    job = QgsMapRendererParallelJob(settings)
    job.start()
    job.waitForFinished()
    assert job.renderedImage().save(picture)
    return [f"{error.layerID}: {error.message}" for error in job.errors()]


if __name__ == "__main__":
    main(*sys.argv[1:])
