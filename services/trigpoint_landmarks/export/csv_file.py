"""CSV (RFC 4180, UTF-8), with the three files beside it that say what its columns and its CRS are."""

import json
from collections.abc import Iterator
from pathlib import Path

from trigpoint.geodesy.projection import crs_definition
from trigpoint.landmarks.feature_crs import FeatureCrs
from trigpoint.landmarks.geojson import JsonObject
from trigpoint.landmarks.layers import Layer
from trigpoint_landmarks.export.columns import Cell, Column, cells_of, columns_of
from trigpoint_landmarks.export.export import Export
from trigpoint_landmarks.export.placed import Points

END = "\r\n"
FORMULA_BEGINS = ("=", "+", "-", "@", "\t", "\r", "\n")  # what a spreadsheet runs (OWASP, CSV injection)
QUOTE_MARK = "'"
GDAL_TYPES = {"string": "String", "number": "Real", "integer": "Integer64", "boolean": "Integer(Boolean)"}
CSVW_TYPES = {"string": "string", "number": "double", "integer": "long", "boolean": "boolean"}
NOTE = (
    "A text that begins with = + - @, a tab or a line end, which a spreadsheet would run as a formula, or with an "
    "apostrophe, has an apostrophe put before it: whoever reads the file takes one away. A text is always quoted, an "
    "empty cell without quotes is no value."
)


def write_csv(path: Path, export: Export) -> None:
    """The layer as a table: a point as two columns named by CRS and unit, a line as WKT."""
    layer = export.layer
    names = [*(one.name for one in place_columns(layer, export.crs)), *(one.name for one in columns_of(layer))]
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(names) + END)
        for batch in export.features(layer):
            file.writelines(
                ",".join(map(cell_text, (*_place(one.points, layer), *cells_of(layer, one.properties)))) + END
                for one in batch
            )


def beside_csv(path: Path, export: Export) -> Iterator[tuple[Path, bytes]]:
    """The files beside a CSV file: types and CRS as GDAL and QGIS read them, and all of it as CSV on the Web (W3C)."""
    layer = export.layer
    yield path.with_suffix(".csvt"), ",".join(_gdal_types(layer, export.crs)).encode()
    if layer.geometry:
        yield path.with_suffix(".prj"), crs_definition(export.crs.crs).wkt.encode()
    metadata = json.dumps(_metadata(path.name, export), ensure_ascii=False, indent=1)
    yield metadata_path(path), f"{metadata}\n".encode()


def metadata_path(path: Path) -> Path:
    """Where CSV on the Web looks for what a CSV file is."""
    return path.with_name(f"{path.name}-metadata.json")


def place_columns(layer: Layer, crs: FeatureCrs) -> tuple[Column, ...]:
    """The columns of a feature's place."""
    if layer.geometry == "LineString":
        return (Column("wkt", "string", f"The path in {crs.crs}, x or longitude first"),)
    if not layer.geometry:
        return ()
    named = f"{crs.crs.replace(':', '_').lower()}_" if crs.uri and not crs.is_wgs84 else ""
    first, second = ("lon_deg", "lat_deg") if crs.in_degrees else ("x_m", "y_m")
    prefix = named or ("" if crs.in_degrees else "grid_")
    return (
        Column(f"{prefix}{first}", "number", f"Longitude or easting in {crs.crs}"),
        Column(f"{prefix}{second}", "number", f"Latitude or northing in {crs.crs}"),
    )


def cell_text(cell: Cell) -> str:
    """A cell as CSV: nothing for no value, a text in quotes and no formula."""
    match cell:
        case None:
            return ""
        case bool():
            return "true" if cell else "false"
        case str():
            escaped = QUOTE_MARK + cell if cell.startswith((*FORMULA_BEGINS, QUOTE_MARK)) else cell
            return '"' + escaped.replace('"', '""') + '"'
        case _:
            return repr(cell)


def _place(points: Points, layer: Layer) -> tuple[Cell, ...]:
    if layer.geometry == "LineString":
        return (f"LINESTRING ({', '.join(f'{x!r} {y!r}' for x, y in points)})" if points else None,)
    if not layer.geometry:
        return ()
    return points[0] if points else (None, None)


def _gdal_types(layer: Layer, crs: FeatureCrs) -> list[str]:
    own = {0: (), 1: ("WKT",), 2: ("CoordX", "CoordY")}[len(place_columns(layer, crs))]
    return [*own, *(GDAL_TYPES[one.kind] for one in columns_of(layer))]


def _metadata(name: str, export: Export) -> JsonObject:
    columns = (*place_columns(export.layer, export.crs), *columns_of(export.layer))
    return {
        "@context": "http://www.w3.org/ns/csvw",
        "url": name,
        "dc:title": export.layer.title,
        "dc:description": export.layer.description,
        "notes": [export.provenance.values(), {"texts": NOTE}],
        "tableSchema": {
            "columns": [
                {
                    "titles": one.name,
                    "name": one.name,
                    "datatype": CSVW_TYPES[one.kind],
                    "dc:description": one.description,
                }
                for one in columns
            ]
        },
    }
