"""KML 2.2 (OGC 07-147r2): always on WGS84, a folder a layer, every property as typed data."""

from collections.abc import Iterator
from pathlib import Path
from typing import TextIO
from xml.sax.saxutils import escape, quoteattr

from trigpoint.landmarks.layers import ANCHORS, LANDMARKS, Layer
from trigpoint.landmarks.xml_text import xml_text
from trigpoint_landmarks.export.colours import PALETTE, colour_number
from trigpoint_landmarks.export.columns import Cell, Column, cells_of, columns_of
from trigpoint_landmarks.export.export import Export, told_apart_by
from trigpoint_landmarks.export.placed import PlacedFeature, Points

KINDS = {"string": "string", "number": "double", "integer": "int", "boolean": "bool"}
LINE_WIDTH_PX = 2
SCALES = {LANDMARKS.name: 0.6, ANCHORS.name: 0.9}


def write_kml(path: Path, export: Export) -> None:
    """The layers as folders of placemarks, coloured as styles tell them apart."""
    with path.open("w", encoding="utf-8", newline="\n") as file:
        version = export.provenance.map_version
        file.write('<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2"><Document>')
        file.write(f"<name>Landmark map, version {version}</name>\n")
        file.writelines(_styles())
        for layer in export.layers:
            file.writelines(_schema(layer))
        file.writelines(_document_data(export))
        for layer in export.layers:
            _write_layer(file, export, layer)
        file.write("</Document></kml>\n")


def _document_data(export: Export) -> Iterator[str]:
    yield "<ExtendedData>"
    for name, value in export.provenance.values().items():
        if value is not None:
            yield f"<Data name={_attribute(name)}><value>{_text(str(value))}</value></Data>\n"
    yield "</ExtendedData>\n"


def _styles() -> Iterator[str]:
    for number, (red, green, blue) in enumerate(PALETTE):
        colour = f"<color>ff{blue:02x}{green:02x}{red:02x}</color>"  # alpha, then backwards
        for layer, scale in SCALES.items():
            yield f'<Style id="{layer}-{number}"><IconStyle>{colour}<scale>{scale}</scale></IconStyle>'
            yield "<LabelStyle><scale>0</scale></LabelStyle></Style>\n"
        line = f"<LineStyle>{colour}<width>{LINE_WIDTH_PX}</width></LineStyle>"
        yield f'<Style id="trajectories-{number}">{line}</Style>\n'


def _schema(layer: Layer) -> Iterator[str]:
    yield f"<Schema name={_attribute(layer.name)} id={_attribute(layer.name)}>\n"
    for one in columns_of(layer):
        said = f"{one.name}: {one.description}"
        yield f'<SimpleField type="{_kind(one)}" name={_attribute(one.name)}>'
        yield f"<displayName>{_text(said)}</displayName></SimpleField>\n"
    yield "</Schema>\n"


def _kind(column: Column) -> str:
    return "string" if column.name.endswith("_ns") else KINDS[column.kind]  # its int has 32 bits


def _write_layer(file: TextIO, export: Export, layer: Layer) -> None:
    file.write(f"<Folder><name>{layer.name}</name><description>{_text(layer.description)}</description>\n")
    columns = columns_of(layer)
    for batch in export.features(layer):
        file.writelines(_placemark(one, layer, columns) for one in batch)
    file.write("</Folder>\n")


def _placemark(feature: PlacedFeature, layer: Layer, columns: tuple[Column, ...]) -> str:
    cells = cells_of(layer, feature.properties)
    data = "".join(
        f"<SimpleData name={_attribute(column.name)}>{_cell(cell)}</SimpleData>"
        for column, cell in zip(columns, cells, strict=True)
        if cell is not None
    )
    return (
        f"<Placemark><name>{_text(feature.feature_id)}</name>{_style(feature, layer)}"
        f'<ExtendedData><SchemaData schemaUrl="#{layer.name}">{data}</SchemaData></ExtendedData>'
        f"{_geometry(feature.points)}</Placemark>\n"
    )


def _style(feature: PlacedFeature, layer: Layer) -> str:
    if not layer.geometry:
        return ""
    return f"<styleUrl>#{layer.name}-{colour_number(told_apart_by(feature, layer))}</styleUrl>"


def _geometry(points: Points) -> str:
    if not points:
        return ""
    coordinates = " ".join(f"{x!r},{y!r}" for x, y in points)
    kind = "Point" if len(points) == 1 else "LineString"
    return f"<{kind}><coordinates>{coordinates}</coordinates></{kind}>"


def _cell(cell: Cell) -> str:
    if isinstance(cell, bool):
        return "1" if cell else "0"
    return _text(str(cell))


def _text(text: str) -> str:
    return escape(xml_text(text))


def _attribute(text: str) -> str:
    return quoteattr(xml_text(text))
