"""Symbols and styles as QGIS 3 keeps them in XML, with only what differs from its defaults."""

from collections.abc import Mapping, Sequence
from typing import Literal
from xml.etree.ElementTree import Element, SubElement, tostring

from trigpoint.landmarks.xml_text import xml_text

SymbolKind = Literal["marker", "line", "fill"]
QGIS_VERSION = "3.22"
DOCTYPE = "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n"
RENDERED = {"symbollevels": "0", "enableorderby": "0", "forceraster": "0", "referencescale": "-1"}
BY_EXPRESSION = "3"  # QGIS' number of a property that an expression gives

Colour = tuple[int, int, int]


def style_text(renderer: Element) -> str:
    """A layer's style as QML."""
    root = Element("qgis", {"version": QGIS_VERSION, "styleCategories": "Symbology"})
    root.append(renderer)
    return DOCTYPE + tostring(root, encoding="unicode")


def categorized(expression: str, categories: Sequence[tuple[str, str, Element]]) -> Element:
    """A renderer of categories, each with a value of the expression (a column, or more), a label, and its symbol named
    by its number; the value "" stands for all others."""
    element = Element("renderer-v2", {"type": "categorizedSymbol", "attr": expression, **RENDERED})
    listed, symbols = SubElement(element, "categories"), SubElement(element, "symbols")
    for number, (value, label, drawn) in enumerate(categories):
        said = {"symbol": str(number), "value": value, "label": label, "render": "true"}
        SubElement(listed, "category", said)
        symbols.append(drawn)
    return element


def symbol(kind: SymbolKind, name: str, layers: Sequence[Element]) -> Element:
    """A symbol of layers, the lowest first."""
    element = Element("symbol", {"type": kind, "name": name, "alpha": "1", "clip_to_extent": "1", "force_rhr": "0"})
    element.extend(layers)
    return element


def simple_marker(*, shape: str, colour: Colour, size_mm: float) -> Element:
    """A marker of one size on the screen."""
    values = {"name": shape, "color": _rgba(colour), "size": str(size_mm), "outline_color": "255,255,255,255"}
    return _layer("SimpleMarker", {**values, "outline_width": "0.2"})


def simple_line(*, colour: Colour, width_mm: float, colour_expression: str = "") -> Element:
    """A line; by an expression its colour differs from feature to feature."""
    element = _layer("SimpleLine", {"line_color": _rgba(colour), "line_width": str(width_mm), "capstyle": "round"})
    if colour_expression:
        _define(element, "outlineColor", colour_expression)
    return element


def simple_fill(*, colour: Colour, opacity: float, outline_mm: float) -> Element:
    """A fill with an outline of its colour."""
    values = {"color": _rgba(colour, opacity), "outline_color": _rgba(colour), "outline_width": str(outline_mm)}
    return _layer("SimpleFill", values)


def arrow(*, colour: Colour) -> Element:
    """A straight arrow along a line, its head at the end."""
    sizes = {"arrow_width": "0.4", "arrow_start_width": "0.4", "head_length": "1.5", "head_thickness": "1"}
    element = _layer("ArrowLine", {**sizes, "is_curved": "0", "is_repeated": "0"})
    element.append(symbol("fill", "@0@0", [simple_fill(colour=colour, opacity=1.0, outline_mm=0.0)]))
    return element


def generated(expression: str, drawn: Element) -> Element:
    """What an expression makes of a feature's geometry, drawn by a fill or line symbol, in units of the layer's CRS."""
    kinds = {"fill": "Fill", "line": "Line"}
    values = {"SymbolType": kinds[drawn.attrib["type"]], "geometryModifier": expression, "units": "MapUnit"}
    element = _layer("GeometryGenerator", values)
    element.append(drawn)
    return element


def _layer(kind: str, values: Mapping[str, str]) -> Element:
    element = Element("layer", {"class": kind, "enabled": "1", "locked": "0", "pass": "0"})
    options = SubElement(element, "Option", {"type": "Map"})
    for name, value in values.items():
        SubElement(options, "Option", {"name": name, "type": "QString", "value": xml_text(value)})
    for name, value in values.items():  # as QGIS before 3.18 has it
        SubElement(element, "prop", {"k": name, "v": xml_text(value)})
    return element


def _define(layer: Element, name: str, expression: str) -> None:
    """A property of a symbol layer given by an expression."""
    collection = SubElement(SubElement(layer, "data_defined_properties"), "Option", {"type": "Map"})
    SubElement(collection, "Option", {"name": "name", "type": "QString", "value": ""})
    properties = SubElement(collection, "Option", {"name": "properties", "type": "Map"})
    SubElement(collection, "Option", {"name": "type", "type": "QString", "value": "collection"})
    own = SubElement(properties, "Option", {"name": name, "type": "Map"})
    for key, kind, value in (
        ("active", "bool", "true"),
        ("expression", "QString", expression),
        ("type", "int", BY_EXPRESSION),
    ):
        SubElement(own, "Option", {"name": key, "type": kind, "value": value})


def _rgba(colour: Colour, opacity: float = 1.0) -> str:
    return ",".join(map(str, (*colour, round(255 * opacity))))
