"""GeoParquet 1.1: WKB with the CRS as PROJJSON and its epoch, written page by page."""

import json
import math
import struct
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from trigpoint.errors import InputError
from trigpoint.geodesy.projection import crs_projjson
from trigpoint.landmarks.geojson import JsonObject
from trigpoint.landmarks.layers import Layer
from trigpoint_landmarks.export.columns import cells_of, columns_of, described
from trigpoint_landmarks.export.export import Export
from trigpoint_landmarks.export.placed import Points
from trigpoint_landmarks.export.reading import Batch

VERSION = "1.1.0"
GEOMETRY = "geometry"
TYPES = {"string": pa.string(), "number": pa.float64(), "integer": pa.int64(), "boolean": pa.bool_()}
WKB_POINT, WKB_LINE = 1, 2


def write_geoparquet(path: Path, export: Export) -> None:
    """The layer, x or longitude first. Raises InputError for a layer without geometry."""
    layer = export.layer
    if not layer.geometry:
        raise InputError(f"layer {layer.name} has no geometry, which GeoParquet needs: csv, geojson and gpkg hold it")
    schema = _schema(layer)
    bounds = _Bounds()
    # Without Arrow's own copy of the schema: with one, Arrow's readers would see none of the metadata added at the end.
    with pq.ParquetWriter(path, schema, compression="zstd", store_schema=False) as writer:
        for batch in export.features(layer):
            bounds.add(batch)
            writer.write_table(_table(batch, layer, schema))
        writer.add_key_value_metadata({"geo": json.dumps(_geo(export, bounds)), "trigpoint": json.dumps(_said(export))})


class _Bounds:
    """The box around all that was added."""

    def __init__(self) -> None:
        self.west = self.south = math.inf
        self.east = self.north = -math.inf

    def add(self, batch: Batch) -> None:
        for x, y in (point for one in batch for point in one.points):
            self.west, self.east = min(self.west, x), max(self.east, x)
            self.south, self.north = min(self.south, y), max(self.north, y)


def _schema(layer: Layer) -> pa.Schema:
    columns = [pa.field(one.name, TYPES[one.kind]) for one in columns_of(layer)]
    return pa.schema([pa.field(GEOMETRY, pa.binary()), *columns])


def _said(export: Export) -> JsonObject:
    return {"provenance": export.provenance.values(), "columns": described(columns_of(export.layer))}


def _table(batch: Batch, layer: Layer, schema: pa.Schema) -> pa.Table:
    rows = [(_wkb(one.points), *cells_of(layer, one.properties)) for one in batch]
    columns = list(zip(*rows, strict=True)) or [()] * len(schema)
    return pa.table([pa.array(column, field.type) for column, field in zip(columns, schema, strict=True)], schema)


def _wkb(points: Points) -> bytes | None:
    if not points:
        return None
    if len(points) == 1:
        return struct.pack("<BIdd", 1, WKB_POINT, *points[0])
    flat = [value for point in points for value in point]
    return struct.pack(f"<BII{len(flat)}d", 1, WKB_LINE, len(points), *flat)


def _geo(export: Export, bounds: _Bounds) -> JsonObject:
    """The metadata of the geometry column."""
    column: JsonObject = {
        "encoding": "WKB",
        "geometry_types": [export.layer.geometry],
        "crs": crs_projjson("OGC:CRS84" if export.crs.is_wgs84 else export.crs.crs),
        "edges": "planar",
    }
    if export.provenance.coordinate_epoch is not None:
        column["epoch"] = export.provenance.coordinate_epoch
    if bounds.west <= bounds.east:
        column["bbox"] = [bounds.west, bounds.south, bounds.east, bounds.north]
    return {"version": VERSION, "primary_column": GEOMETRY, "columns": {GEOMETRY: column}}
