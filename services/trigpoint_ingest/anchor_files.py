"""Anchors from files people make: GeoJSON, GeoPackage and CSV, in any CRS they state."""

import csv
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError
from pyogrio import errors as ogr_errors
from pyogrio import raw as ogr
from shapely import Point, from_wkb

from trigpoint.errors import FrameRefused, InputError
from trigpoint.geodesy.projection import WGS84
from trigpoint_ingest.core.anchors import AnchorRow, LabelledAnchors, labelled

GEOJSON_SUFFIXES = (".geojson", ".json")
CRS84_NAMES = ("urn:ogc:def:crs:OGC:1.3:CRS84", "urn:ogc:def:crs:OGC::CRS84", "OGC:CRS84")
NAME_COLUMNS = ("anchor", "id", "name", "fid")
EAST_COLUMNS = ("easting", "easting_m", "x", "x_m")
NORTH_COLUMNS = ("northing", "northing_m", "y", "y_m")
LONGITUDE_COLUMNS = ("lon", "lon_deg", "longitude")
LATITUDE_COLUMNS = ("lat", "lat_deg", "latitude")

Fields = Mapping[str, object]


class _CrsProperties(BaseModel):
    name: str


class _CrsMember(BaseModel):
    """The crs member of GeoJSON before RFC 7946."""

    type: str
    properties: _CrsProperties


class _Geometry(BaseModel):
    type: str
    coordinates: object


class _Feature(BaseModel):
    geometry: _Geometry | None
    properties: dict[str, object] | None = None
    id: str | int | None = None


class _Collection(BaseModel):
    """A GeoJSON FeatureCollection; what else is in it is not looked at."""

    model_config = ConfigDict(extra="ignore")
    type: str
    features: list[_Feature]
    crs: _CrsMember | None = None


def read_anchor_file(
    path: Path, *, crs: str | None = None, image: str | None = None, sigma_m: float | None = None
) -> LabelledAnchors:
    """The file's anchors in WGS84 and those refused. `crs`, `image` and `sigma_m`, if given, hold for all of them.

    Properties or columns: anchor (or id, name), image, sigma_m, image_sigma_m, kind, signature; a CSV has lat and lon,
    or easting and northing (or x and y), and a column crs unless `crs` is given. Latitudes and longitudes without
    a CRS are WGS84, and so is GeoJSON without a crs member.

    Raises InputError for a file that cannot be read as what it is, FrameRefused for an unknown or missing CRS.
    """
    if not path.is_file():
        raise InputError(f"{path} is not a file: anchors come as GeoJSON, GeoPackage or CSV")
    rows = _rows(path, crs)
    if not rows:
        raise InputError(f"{path} holds no anchor")
    return labelled([_overridden(row, image=image, sigma_m=sigma_m) for row in rows])


def _rows(path: Path, crs: str | None) -> list[AnchorRow]:
    suffix = path.suffix.lower()
    if suffix == ".csv":
        return _csv_rows(path, crs)
    if suffix in GEOJSON_SUFFIXES:
        return _geojson_rows(path, crs)
    if suffix == ".gpkg":
        return _geopackage_rows(path, crs)
    raise InputError(f"{path}: {suffix!r} is none of .geojson, .json, .gpkg, .csv")


def _overridden(row: AnchorRow, *, image: str | None, sigma_m: float | None) -> AnchorRow:
    return replace(
        row,
        image=row.image if image is None else image,
        sigma_m=row.sigma_m if sigma_m is None else sigma_m,
    )


def _csv_rows(path: Path, crs: str | None) -> list[AnchorRow]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file)
            columns = [name.strip().lower() for name in reader.fieldnames or ()]
            reader.fieldnames = columns
            lines = [(f"{path}, line {reader.line_num}", line) for line in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path} cannot be read as CSV: {error}") from error
    x_column, y_column, geographic = _position_columns(columns, path)
    return [
        _row(
            fields,
            x=_number(fields, x_column, where=where),
            y=_number(fields, y_column, where=where),
            crs=crs or _csv_crs(fields, geographic=geographic, where=where),
            where=where,
        )
        for where, fields in lines
    ]


def _position_columns(columns: Sequence[str], path: Path) -> tuple[str, str, bool]:
    """The columns of x and y, and whether they are longitude and latitude."""
    for x_names, y_names, geographic in (
        (LONGITUDE_COLUMNS, LATITUDE_COLUMNS, True),
        (EAST_COLUMNS, NORTH_COLUMNS, False),
    ):
        x_column = next((name for name in x_names if name in columns), None)
        y_column = next((name for name in y_names if name in columns), None)
        if x_column is not None and y_column is not None:
            return x_column, y_column, geographic
    raise InputError(f"{path} has columns {', '.join(columns) or 'none'}: lat and lon, or easting and northing, needed")


def _csv_crs(fields: Fields, *, geographic: bool, where: str) -> str:
    stated = _text(fields, "crs")
    if stated:
        return stated
    if geographic:
        return WGS84
    raise FrameRefused(f"{where}: easting and northing without a CRS; name it as --crs or in a column crs")


def _geojson_rows(path: Path, crs: str | None) -> list[AnchorRow]:
    try:
        collection = _Collection.model_validate(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, RecursionError) as error:
        detail = error.errors()[0] if isinstance(error, ValidationError) else error
        raise InputError(f"{path} cannot be read as a GeoJSON FeatureCollection: {detail}") from error
    stated = collection.crs.properties.name if collection.crs is not None else WGS84
    chosen = crs or (WGS84 if stated in CRS84_NAMES else stated)
    return [_geojson_row(feature, chosen, f"{path}, feature {n}") for n, feature in enumerate(collection.features)]


def _geojson_row(feature: _Feature, crs: str, where: str) -> AnchorRow:
    geometry, fields = feature.geometry, dict(feature.properties or {})
    if feature.id is not None:
        fields.setdefault("id", feature.id)
    if geometry is None or geometry.type != "Point" or not isinstance(geometry.coordinates, list):
        raise InputError(f"{where} is {geometry.type if geometry else 'nothing'}: an anchor is a Point")
    point = dict(zip(("x", "y"), geometry.coordinates, strict=False))
    return _row(fields, x=_number(point, "x", where=where), y=_number(point, "y", where=where), crs=crs, where=where)


def _geopackage_rows(path: Path, crs: str | None) -> list[AnchorRow]:
    try:
        meta, fids, geometries, columns = ogr.read(path, return_fids=True)
    except (ogr_errors.DataSourceError, ogr_errors.DataLayerError, ogr_errors.FeatureError, ValueError) as error:
        raise InputError(f"{path} cannot be read as a GeoPackage: {error}") from error
    stated = crs or meta["crs"]
    if not stated:
        raise FrameRefused(f"{path} states no CRS; name it as --crs")
    names = [str(name).lower() for name in meta["fields"]]
    rows = []
    for index, (fid, geometry) in enumerate(zip(fids, geometries, strict=True)):
        fields: dict[str, object] = {name: column[index] for name, column in zip(names, columns, strict=True)}
        fields.setdefault("fid", int(fid))
        rows.append(_geopackage_row(fields, geometry, str(stated), f"{path}, feature {fid}"))
    return rows


def _geopackage_row(fields: Fields, geometry: bytes | None, crs: str, where: str) -> AnchorRow:
    point = None if geometry is None else from_wkb(geometry)
    if not isinstance(point, Point) or point.is_empty:
        raise InputError(f"{where} is {point.geom_type if point is not None else 'nothing'}: an anchor is a Point")
    return _row(fields, x=point.x, y=point.y, crs=crs, where=where)


def _row(fields: Fields, *, x: float, y: float, crs: str, where: str) -> AnchorRow:
    return AnchorRow(
        anchor=next((text for name in NAME_COLUMNS if (text := _text(fields, name))), ""),
        x=x,
        y=y,
        crs=crs,
        sigma_m=_number(fields, "sigma_m", where=where),
        image=_text(fields, "image"),
        image_sigma_m=_number(fields, "image_sigma_m", where=where),
        kind=_text(fields, "kind"),
        signature=_text(fields, "signature"),
    )


def _text(fields: Fields, name: str) -> str:
    value = fields.get(name)
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return str(value).strip()


def _number(fields: Fields, name: str, *, where: str) -> float:
    try:
        return float(_text(fields, name) or "nan")
    except ValueError as error:
        raise InputError(f"{where}: {name} is {_text(fields, name)!r}, a number is needed") from error
