"""A GeoPackage to hand over: the layers as plain tables of one map version, and how QGIS draws them."""

import json
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from trigpoint.landmarks.geopackage_writing import (
    ANY_METADATA,
    GeoPackageWriting,
    Row,
    WrittenTable,
    written_geopackage,
)
from trigpoint.landmarks.layers import Layer
from trigpoint_landmarks.export.columns import cells_of, columns_of
from trigpoint_landmarks.export.export import Export
from trigpoint_landmarks.export.provenance import NS_PER_S
from trigpoint_landmarks.export.qgis_styles import style_document

SQL_TYPES = {"string": "TEXT", "number": "REAL", "integer": "INTEGER", "boolean": "BOOLEAN"}


def write_geopackage(path: Path, export: Export) -> None:
    """The layers, a table each; positions in the export's CRS."""
    provenance = export.provenance
    changed = datetime.fromtimestamp(provenance.solved_ns / NS_PER_S, tz=UTC).strftime("%Y-%m-%dT%H:%M:%S.000Z")
    epoch = provenance.coordinate_epoch
    with written_geopackage(path, crs=export.crs.crs, epoch=epoch, changed=changed) as file:
        for layer in export.layers:
            _write_layer(file, export, layer)
        metadata = json.dumps(provenance.values(), ensure_ascii=False)
        file.describe(metadata, mime_type="application/json", standard=ANY_METADATA)


def _write_layer(file: GeoPackageWriting, export: Export, layer: Layer) -> None:
    table = WrittenTable(
        name=layer.name,
        title=layer.title,
        description=f"{layer.description}; map version {export.provenance.map_version}",
        geometry_name=layer.geometry.upper(),
        columns=tuple((one.name, SQL_TYPES[one.kind]) for one in columns_of(layer)),
    )
    file.write(table, _rows(export, layer))
    if layer.geometry:
        qml = style_document(layer, export.crs.crs, export.provenance.map_crs, export.kinds[layer.name])
        file.style(layer.name, f"{layer.title} of trigpoint", qml)


def _rows(export: Export, layer: Layer) -> Iterator[Iterator[Row]]:
    for batch in export.features(layer):
        yield ((one.points, cells_of(layer, one.properties)) for one in batch)
