"""How QGIS draws the layers of a map: landmarks and their ellipses true to scale, anchors and residuals, paths.

The project variables `trigpoint_sigmas` (1 where it is not set) and `trigpoint_residual_scale` (likewise) enlarge
ellipses and residuals, which are centimetres on a map of kilometres.
"""

from collections.abc import Callable, Sequence
from xml.etree.ElementTree import Element, SubElement

from trigpoint.landmarks.layers import ANCHORS, LANDMARKS, Layer
from trigpoint.landmarks.qgis_symbols import (
    RENDERED,
    Colour,
    arrow,
    categorized,
    generated,
    simple_fill,
    simple_line,
    simple_marker,
    style_text,
    symbol,
)
from trigpoint.landmarks.xml_text import xml_text
from trigpoint_landmarks.export.colours import PALETTE, colour_of

SIGMAS, RESIDUAL_SCALE = "trigpoint_sigmas", "trigpoint_residual_scale"
OTHER_COLOUR = (120, 120, 120)
RESIDUAL_COLOUR = (160, 0, 60)
ELLIPSE_SEGMENTS = 36
DRIVE = '"vehicle" || \':\' || "boot_id"'


def style_document(layer: Layer, crs: str, map_crs: str, kinds: Sequence[str]) -> str:
    """The style of a layer in `crs` as QML; each of its kinds is drawn in its own colour."""
    return style_text(renderer(layer, crs, map_crs, kinds))


def renderer(layer: Layer, crs: str, map_crs: str, kinds: Sequence[str]) -> Element:
    """The renderer of a layer with geometry, in `crs`; lengths and headings are along the grid of `map_crs`."""
    if layer is LANDMARKS:
        ellipse = _in_layer(_ellipse(_on_grid(crs, map_crs)), crs, map_crs)
        return _by_kind(kinds, lambda colour, name: _landmark(colour, name, ellipse))
    if layer is ANCHORS:
        residual = _in_layer(_residual(_on_grid(crs, map_crs)), crs, map_crs)
        return _by_kind(kinds, lambda colour, name: _anchor(colour, name, residual))
    return _single(
        symbol("line", "0", [simple_line(colour=PALETTE[0], width_mm=0.5, colour_expression=_drive_colour())])
    )


def tile_renderer(layer: Layer) -> Element:
    """The renderer of a layer's vector tiles."""
    element = Element("renderer", {"type": "basic"})
    style = {"name": layer.title, "layer": layer.name, "expression": "", "enabled": "1"}
    numbers = {"geometry": "0" if layer.geometry == "Point" else "1", "min-zoom": "-1", "max-zoom": "-1"}
    styles = SubElement(element, "styles")
    symbols = SubElement(SubElement(styles, "style", style | numbers), "symbols")
    if layer.geometry == "Point":
        symbols.append(symbol("marker", "0", [simple_marker(shape="circle", colour=OTHER_COLOUR, size_mm=1.2)]))
    else:
        symbols.append(symbol("line", "0", [simple_line(colour=OTHER_COLOUR, width_mm=0.3)]))
    return element


def _landmark(colour: Colour, name: str, ellipse: str) -> Element:
    area = symbol("fill", f"@{name}@0", [simple_fill(colour=colour, opacity=0.25, outline_mm=0.2)])
    return symbol("marker", name, [generated(ellipse, area), simple_marker(shape="circle", colour=colour, size_mm=1.6)])


def _anchor(colour: Colour, name: str, residual: str) -> Element:
    line = symbol("line", f"@{name}@1", [arrow(colour=RESIDUAL_COLOUR)])
    marker = simple_marker(shape="triangle", colour=colour, size_mm=3.0)
    return symbol("marker", name, [marker, generated(residual, line)])


def _on_grid(crs: str, map_crs: str) -> str:
    return "$geometry" if crs == map_crs else f"transform($geometry, '{crs}', '{map_crs}')"


def _in_layer(expression: str, crs: str, map_crs: str) -> str:
    return expression if crs == map_crs else f"transform({expression}, '{map_crs}', '{crs}')"


def _ellipse(place: str) -> str:
    """The 1-sigma ellipse; QGIS counts headings clockwise from north, in degrees."""
    axes = f'"sigma_major_m" * {_variable(SIGMAS)}, "sigma_minor_m" * {_variable(SIGMAS)}'
    return f'make_ellipse({place}, {axes}, 90 - degrees("ellipse_heading_rad"), {ELLIPSE_SEGMENTS})'


def _residual(place: str) -> str:
    """From the label to where the solved landmark, by its image's offset, has it."""
    east = f'x({place}) - "residual_x_m" * {_variable(RESIDUAL_SCALE)}'
    north = f'y({place}) - "residual_y_m" * {_variable(RESIDUAL_SCALE)}'
    return f"make_line({place}, make_point({east}, {north}))"


def _variable(name: str) -> str:
    return f"to_real(coalesce(@{name}, 1))"


def _drive_colour() -> str:
    """One of the colours by a number made of the drive's name: the same for a drive wherever it is drawn."""
    colours = ", ".join(f"'{red},{green},{blue}'" for red, green, blue in PALETTE)
    number = f"to_int(left(regexp_replace(md5({DRIVE}), '[^0-9]', ''), 6)) % {len(PALETTE)}"
    return f"array_get(array({colours}), {number})"


def _by_kind(kinds: Sequence[str], drawn: Callable[[Colour, str], Element]) -> Element:
    """A colour a kind, and one for whatever comes later."""
    return categorized(
        "kind",
        [
            (xml_text(kind), xml_text(kind) or "others", drawn(colour_of(kind) if kind else OTHER_COLOUR, str(number)))
            for number, kind in enumerate((*filter(None, kinds), ""))
        ],
    )


def _single(drawn: Element) -> Element:
    element = Element("renderer-v2", {"type": "singleSymbol", **RENDERED})
    SubElement(element, "symbols").append(drawn)
    return element
