"""Features in the CRS of a file: x or longitude always first, as GIS files want it, whatever the CRS's own order."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trigpoint.errors import InputError
from trigpoint.geodesy.projection import WGS84, crs_unit, transform_coordinates
from trigpoint.landmarks.feature_crs import CRS84, EPSG_URI, FeatureCrs, storage_crs
from trigpoint.landmarks.geojson import JsonObject

Points = tuple[tuple[float, float], ...]
CRS_FORM = re.compile(r"EPSG:([1-9][0-9]{0,8})", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class PlacedFeature:
    """A feature: its points in a file's CRS (one: a point, more: a line, none: no geometry), x first."""

    feature_id: str
    points: Points
    properties: JsonObject


def crs_of(text: str) -> FeatureCrs:
    """The CRS of "EPSG:<code>" or "OGC:CRS84". Raises InputError for any other text, FrameRefused for its CRS."""
    if text.upper() in ("OGC:CRS84", "CRS84", WGS84):
        return CRS84
    code = CRS_FORM.fullmatch(text)
    if code is None:
        raise InputError(f"crs {text[:80]!r} is not EPSG:<code> or OGC:CRS84")
    crs = text.upper()
    return FeatureCrs(uri=f"{EPSG_URI}{code[1]}", crs=crs, north_first=False, in_degrees=crs_unit(crs) == "deg")


def map_crs_of(crs: str) -> FeatureCrs:
    """The CRS a map is in, which may have no code."""
    if CRS_FORM.fullmatch(crs):
        return crs_of(crs)
    return FeatureCrs(uri="", crs=crs, north_first=False, in_degrees=crs_unit(crs) == "deg")


def source_crs(wanted: FeatureCrs, map_crs: str) -> FeatureCrs:
    """What features are asked for in: the map's own CRS where it is wanted and has a name, else degrees."""
    stored = storage_crs(map_crs)
    return stored if wanted.crs == map_crs == stored.crs else CRS84


def placed(page: bytes, asked: FeatureCrs, wanted: FeatureCrs) -> list[PlacedFeature]:
    """The features of a page that was asked for in one CRS, in another one. Raises FrameRefused."""
    features: list[JsonObject] = json.loads(b"[" + page + b"]")
    lines = [_points(one["geometry"], north_first=asked.north_first) for one in features]
    if asked.crs != wanted.crs:
        lines = _moved(lines, asked.crs, wanted)
    return [
        PlacedFeature(str(one["id"]), points, one["properties"])  # type: ignore[arg-type]  # an object, by GeoJSON
        for one, points in zip(features, lines, strict=True)
    ]


def _points(geometry: object, *, north_first: bool) -> Points:
    if geometry is None:
        return ()
    assert isinstance(geometry, dict)
    pairs = geometry["coordinates"] if geometry["type"] == "LineString" else [geometry["coordinates"]]
    return tuple((second, first) if north_first else (first, second) for first, second in pairs)


def _moved(lines: Sequence[Points], source: str, wanted: FeatureCrs) -> list[Points]:
    """The points of many features in another CRS, all at once."""
    flat = np.array([point for points in lines for point in points], dtype=np.float64).reshape(-1, 2)
    if not len(flat):
        return list(lines)
    x, y = transform_coordinates(flat[:, 0], flat[:, 1], source_crs=source, target_crs=wanted.crs)
    pairs = np.round(np.column_stack([x, y]), wanted.decimals).tolist()
    ends = np.cumsum([len(points) for points in lines]).tolist()
    return [tuple((x, y) for x, y in pairs[end - len(points) : end]) for points, end in zip(lines, ends, strict=True)]
