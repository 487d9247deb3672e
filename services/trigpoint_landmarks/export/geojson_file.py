"""GeoJSON: as RFC 7946 has it on WGS84; in another CRS as GeoJSON of 2008 had it, with a `crs` member."""

import json
from pathlib import Path

from trigpoint.errors import InputError
from trigpoint.landmarks.geojson import JsonObject
from trigpoint_landmarks.export.export import Export
from trigpoint_landmarks.export.placed import PlacedFeature

URN = "urn:ogc:def:crs:EPSG::"


def write_geojson(path: Path, export: Export) -> None:
    """The layer as a FeatureCollection, properties as over HTTP. Raises InputError for a CRS without an EPSG code."""
    head: JsonObject = {"type": "FeatureCollection", "name": export.layer.name, **_crs(export)}
    head |= {"map_version": export.provenance.map_version, "provenance": export.provenance.values()}
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(f'{json.dumps(head, ensure_ascii=False)[:-1]}, "features": [')
        before = "\n"
        for batch in export.features(export.layer):
            for feature in batch:
                file.write(before + json.dumps(_feature(feature), ensure_ascii=False, allow_nan=False))
                before = ",\n"
        file.write("\n]}\n")


def _crs(export: Export) -> JsonObject:
    if export.crs.is_wgs84:
        return {}
    if not export.crs.uri:
        raise InputError(
            f"crs {export.crs.crs[:80]!r} has no EPSG code, by which GeoJSON would name it: --crs EPSG:4326"
        )
    code = export.crs.crs.partition(":")[2]
    return {"crs": {"type": "name", "properties": {"name": f"{URN}{code}"}}}


def _feature(feature: PlacedFeature) -> JsonObject:
    return {
        "type": "Feature",
        "id": feature.feature_id,
        "geometry": _geometry(feature),
        "properties": feature.properties,
    }


def _geometry(feature: PlacedFeature) -> JsonObject | None:
    match feature.points:
        case ():
            return None
        case (point,):
            return {"type": "Point", "coordinates": point}
        case points:
            return {"type": "LineString", "coordinates": points}
