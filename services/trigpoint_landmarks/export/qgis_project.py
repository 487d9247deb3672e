"""A QGIS project of a map: its layers styled, in the map's CRS, from a service or from an exported GeoPackage."""

import io
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, tostring

from trigpoint.geodesy.projection import crs_definition, crs_wkt2
from trigpoint.landmarks.layers import Layer
from trigpoint.landmarks.qgis_symbols import DOCTYPE, QGIS_VERSION
from trigpoint.landmarks.xml_text import xml_text
from trigpoint_landmarks.export.qgis_styles import (
    RESIDUAL_SCALE,
    SIGMAS,
    renderer,
    tile_renderer,
)

GROUP = "Landmark map"
VARIABLES = {SIGMAS: "1", RESIDUAL_SCALE: "1"}
ZIP_DATE = (1980, 1, 1, 0, 0, 0)  # the same project gives the same bytes
MERCATOR = "EPSG:3857"


@dataclass(frozen=True, slots=True, kw_only=True)
class ProjectLayer:
    """A layer of a project: where QGIS has it from, and in what CRS that gives it.

    `kinds` get a colour each. A layer of a scale limit, 1 to that, is drawn only nearer than that; one that is `tiled`
    comes as vector tiles.
    """

    layer: Layer
    name: str
    provider: str
    source: str
    crs: str
    kinds: tuple[str, ...] = ()
    scale_limit: int | None = None
    tiled: bool = False

    @property
    def identity(self) -> str:
        """Its name among the project's layers."""
        return f"{self.layer.name}_{'tiles' if self.tiled else 'features'}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Project:
    """A project: layers from top to bottom, and what is shown first (west, south, east, north in the map's CRS)."""

    title: str
    abstract: str
    map_crs: str
    extent: tuple[float, float, float, float] | None
    layers: tuple[ProjectLayer, ...]


def project_file(project: Project, *, name: str, zipped: bool) -> bytes:
    """The project as a .qgs file, or zipped with `name` inside as a .qgz file."""
    content = (DOCTYPE + tostring(_document(project), encoding="unicode")).encode()
    if not zipped:
        return content
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(zipfile.ZipInfo(name, ZIP_DATE), content, zipfile.ZIP_DEFLATED)
    return file.getvalue()


def _document(project: Project) -> Element:
    root = Element("qgis", {"version": QGIS_VERSION, "projectname": xml_text(project.title)})
    SubElement(root, "title").text = xml_text(project.title)
    SubElement(root, "projectCrs").append(_reference(project.map_crs))
    root.append(_tree(project.layers))
    layers = SubElement(root, "projectlayers")
    for one in project.layers:
        layers.append(_tiles(one) if one.tiled else _features(one, project.map_crs))
    order = SubElement(root, "layerorder")
    for one in project.layers:
        SubElement(order, "layer", {"id": one.identity})
    root.append(_properties())
    metadata = SubElement(root, "projectMetadata")
    SubElement(metadata, "title").text = xml_text(project.title)
    SubElement(metadata, "abstract").text = xml_text(project.abstract)
    if project.extent is not None:
        root.append(_view(project.extent, project.map_crs))
    return root


def _tree(layers: Sequence[ProjectLayer]) -> Element:
    root = Element("layer-tree-group")
    group = SubElement(root, "layer-tree-group", {"name": GROUP, "checked": "Qt::Checked", "expanded": "1"})
    for one in layers:
        said = {"id": one.identity, "name": one.name, "providerKey": one.provider, "source": one.source}
        SubElement(group, "layer-tree-layer", {**said, "checked": "Qt::Checked", "expanded": "1"})
    return root


def _features(one: ProjectLayer, map_crs: str) -> Element:
    element = _layer(one, "vector")
    element.set("geometry", "Point" if one.layer.geometry == "Point" else "Line")
    if one.layer.geometry:
        element.append(renderer(one.layer, one.crs, map_crs, one.kinds))
    else:
        element.set("geometry", "No geometry")
    return element


def _tiles(one: ProjectLayer) -> Element:
    element = _layer(one, "vector-tile")
    element.append(tile_renderer(one.layer))
    return element


def _layer(one: ProjectLayer, kind: str) -> Element:
    limited = one.scale_limit is not None
    scales = {"hasScaleBasedVisibilityFlag": str(int(limited)), "minScale": str(one.scale_limit or 100_000_000)}
    element = Element("maplayer", {"type": kind, **scales, "maxScale": "0"})
    SubElement(element, "id").text = one.identity
    SubElement(element, "datasource").text = xml_text(one.source)
    SubElement(element, "layername").text = xml_text(one.name)
    SubElement(element, "srs").append(_reference(one.crs))
    SubElement(element, "provider", {"encoding": "UTF-8"}).text = one.provider
    return element


def _reference(crs: str) -> Element:
    """A CRS by its definition, and by its name where it has one."""
    known = crs_definition(crs)
    element = Element("spatialrefsys")
    SubElement(element, "wkt").text = crs_wkt2(crs)
    SubElement(element, "description").text = known.name
    if known.authority:
        SubElement(element, "authid").text = f"{known.authority}:{known.code}"
        SubElement(element, "srid").text = str(known.code)
    return element


def _properties() -> Element:
    properties = Element("properties")
    SubElement(SubElement(properties, "Paths"), "Absolute", {"type": "bool"}).text = "false"
    enabled = SubElement(SubElement(properties, "SpatialRefSys"), "ProjectionsEnabled", {"type": "int"})
    enabled.text = "1"
    variables = SubElement(properties, "Variables")
    names = SubElement(variables, "variableNames", {"type": "QStringList"})
    values = SubElement(variables, "variableValues", {"type": "QStringList"})
    for name, value in VARIABLES.items():
        SubElement(names, "value").text = name
        SubElement(values, "value").text = value
    return properties


def _view(extent: tuple[float, float, float, float], crs: str) -> Element:
    view = Element("ProjectViewSettings", {"UseProjectScales": "0"})
    sides = dict(zip(("xmin", "ymin", "xmax", "ymax"), map(str, extent), strict=True))
    SubElement(view, "DefaultViewExtent", sides).append(_reference(crs))
    return view
