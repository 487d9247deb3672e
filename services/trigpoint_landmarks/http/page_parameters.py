"""A page's parameters, as OGC API Features names them, as a question to the database."""

import re
from collections.abc import Callable, Mapping
from datetime import UTC, datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.landmarks.conditions import AllOf, Compared, Condition, Given, OfFeature
from trigpoint.landmarks.cql2_conditions import condition_from_json, condition_from_text
from trigpoint.landmarks.feature_crs import CRS84, CRS84_URI, FeatureCrs, crs_of_uri, degrees_of
from trigpoint.landmarks.feature_query import PAGE_MOST, FeatureQuery, GridBox, MapState
from trigpoint.landmarks.layers import Layer, Property
from trigpoint.landmarks.queries import LAT_LIMIT_DEG, LON_LIMIT_DEG, DegreeBox, TimeSpan
from trigpoint_landmarks.http.asked import Asked, numbers_of

PAGE_DEFAULT = 100  # features
FIXED = ("bbox", "bbox-crs", "crs", "datetime", "limit", "filter", "filter-lang", "filter-crs", "as_of", "from", "f")
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
MICROSECOND_NS = 1000
BEGINNING_NS, END_NS = -(2**63), 2**63 - 1
INSTANT = re.compile(r"\d{4}-\d{2}-\d{2}([Tt ]\d{2}:\d{2}:\d{2}(\.\d{1,9})?([Zz]|[+-]\d{2}:\d{2}))?")
DEGREES_BOUND = (LON_LIMIT_DEG, LAT_LIMIT_DEG)

Readers: Mapping[str, Callable[..., Condition]] = {"cql2-text": condition_from_text, "cql2-json": condition_from_json}


def page_query(asked: Asked, layer: Layer, state: MapState, *, as_of: int | None) -> FeatureQuery:
    """The question for a page of a layer's features. Raises InputError for a parameter that cannot be."""
    asked.require_only((*FIXED, *(one.name for one in layer.properties if one.comparable)))
    if asked.parameters.get("f", "json") not in ("json", "geojson"):
        raise InputError(f"f {asked.parameters['f'][:40]!r}: json is there")
    limit = asked.whole("limit")
    if limit is not None and limit < 1:
        raise InputError(f"limit {limit} is under 1")
    return FeatureQuery(
        layer=layer,
        limit=PAGE_DEFAULT if limit is None else min(limit, PAGE_MOST),
        as_of=as_of,
        areas=_areas(asked, state),
        during=_during(asked),
        condition=_condition(asked, layer, state),
        first_id=asked.parameters.get("from"),
        crs=_crs(asked, "crs", state),
    )


def item_query(asked: Asked, layer: Layer, state: MapState, feature_id: str, *, as_of: int | None) -> FeatureQuery:
    """The question for one feature. Raises InputError for a parameter that cannot be."""
    asked.require_only(("crs", "as_of", "f"))
    if "\0" in feature_id or any("\ud800" <= one <= "\udfff" for one in feature_id):
        raise InputError("an id holds a character that no database keeps")
    return FeatureQuery(layer=layer, limit=1, as_of=as_of, feature_id=feature_id, crs=_crs(asked, "crs", state))


def _crs(asked: Asked, name: str, state: MapState) -> FeatureCrs:
    uri = asked.parameters.get(name)
    return CRS84 if uri is None or uri == CRS84_URI else crs_of_uri(uri, state.crs)


def _areas(asked: Asked, state: MapState) -> tuple[DegreeBox | GridBox, ...]:
    """The boxes of `bbox` in the system of `bbox-crs`; one across the antimeridian is two."""
    crs = _crs(asked, "bbox-crs", state)
    text = asked.parameters.get("bbox")
    if text is None:
        return ()
    numbers = numbers_of(text, (4, 6), "min1,min2,max1,max2")
    if len(numbers) == 6:
        numbers = [numbers[0], numbers[1], numbers[3], numbers[4]]
    first_min, second_min, first_max, second_max = numbers
    west, south = (second_min, first_min) if crs.north_first else (first_min, second_min)
    east, north = (second_max, first_max) if crs.north_first else (first_max, second_max)
    if south > north:
        raise InputError(f"bbox is inverted: {south} is above {north}")
    if crs.is_wgs84:
        return _degree_boxes(west, south, east, north)
    if west > east:
        raise InputError(f"bbox is inverted: {west} is above {east}")
    if crs.crs == state.crs:
        return (GridBox(easting_min_m=west, northing_min_m=south, easting_max_m=east, northing_max_m=north),)
    lon_deg, lat_deg = degrees_of(crs, np.array([west, east]), np.array([south, north]))
    return _degree_boxes(float(lon_deg[0]), float(lat_deg[0]), float(lon_deg[1]), float(lat_deg[1]))


def _degree_boxes(west: float, south: float, east: float, north: float) -> tuple[DegreeBox, ...]:
    """The part of a box that is on the globe, in two where it crosses the antimeridian."""
    low, high = max(south, -LAT_LIMIT_DEG), min(north, LAT_LIMIT_DEG)
    if low > LAT_LIMIT_DEG or high < -LAT_LIMIT_DEG:
        raise InputError(f"bbox from latitude {south} to {north} is not on the globe")
    spans = [(west, east)] if west <= east else [(west, LON_LIMIT_DEG), (-LON_LIMIT_DEG, east)]
    limited = [(max(start, -LON_LIMIT_DEG), min(end, LON_LIMIT_DEG)) for start, end in spans]
    boxes = tuple(
        DegreeBox(lon_min_deg=start, lat_min_deg=low, lon_max_deg=end, lat_max_deg=high)
        for start, end in limited
        if start <= end
    )
    if not boxes:
        raise InputError(f"bbox from longitude {west} to {east} is not on the globe")
    return boxes


def _during(asked: Asked) -> TimeSpan | None:
    """The span of `datetime`: an instant, or two with a slash between them, either of which may be open."""
    text = asked.parameters.get("datetime")
    if text is None:
        return None
    parts = text.split("/")
    if len(parts) > 2 or parts in (["", ""], ["..", ".."], ["", ".."], ["..", ""], [""], [".."]):
        raise InputError(f"datetime {text[:80]!r}: an instant, or two with a slash between them, is needed")
    first_ns = BEGINNING_NS if parts[0] in ("", "..") else _instant(parts[0])[0]
    last_ns = END_NS if parts[-1] in ("", "..") else _instant(parts[-1])[1]
    return TimeSpan(first_ns=first_ns, last_ns=last_ns)


def _instant(text: str) -> tuple[int, int]:
    """The first and the last nanosecond of an instant or of a day."""
    if not INSTANT.fullmatch(text):
        raise InputError(f"datetime {text[:80]!r}: RFC 3339 is needed, as 2023-11-14T22:13:20Z")
    day = len(text) == len("2023-11-14")
    try:
        parsed = datetime.fromisoformat(f"{text}T00:00:00+00:00" if day else text.upper().replace(" ", "T"))
        begin_ns = (parsed - EPOCH) // timedelta(microseconds=1) * MICROSECOND_NS
    except (ValueError, OverflowError) as error:
        raise InputError(f"datetime {text[:80]!r} is none: {error}") from error
    length_ns = 86_400_000_000_000 if day else MICROSECOND_NS
    return max(BEGINNING_NS, min(begin_ns, END_NS)), max(BEGINNING_NS, min(begin_ns + length_ns - 1, END_NS))


def _condition(asked: Asked, layer: Layer, state: MapState) -> Condition | None:
    """What `filter` and the parameters named like properties say together."""
    parts = [_equal(one, text) for one in layer.properties if (text := asked.parameters.get(one.name)) is not None]
    language = asked.parameters.get("filter-lang", "cql2-text")
    if language not in Readers:
        raise InputError(f"filter-lang {language[:40]!r}: there are {', '.join(Readers)}")
    crs = _crs(asked, "filter-crs", state)
    text = asked.parameters.get("filter")
    if text is not None:
        parts.append(Readers[language](text, layer, _turned(crs)))
    if not parts:
        return None
    return parts[0] if len(parts) == 1 else AllOf(tuple(parts))


def _turned(crs: FeatureCrs) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Coordinates (n, 2) of a system as longitudes and latitudes (n, 2)."""

    def degrees(coordinates: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.column_stack(degrees_of(crs, coordinates[:, 0], coordinates[:, 1]))

    return degrees


def _equal(one: Property, text: str) -> Condition:
    """The property equal to what was given as text."""
    return Compared("=", OfFeature(one), Given(_value(one, text)))


def _value(one: Property, text: str) -> str | int | float | bool:
    if one.kind == "string":
        return text
    if one.kind == "boolean":
        if text not in ("true", "false"):
            raise InputError(f"{one.name} {text[:40]!r}: true or false is needed")
        return text == "true"
    if one.kind == "integer" and re.fullmatch(r"-?[0-9]{1,18}", text):
        return int(text)
    (number,) = numbers_of(text, (1,), "a number")
    return number
