"""OGC CQL2 (21-065r2), text or JSON, as conditions on a layer's features; cql2's one home."""

import json
import math
import re
from collections.abc import Callable
from functools import lru_cache
from typing import Any, get_args

import cql2
import numpy as np
from numpy.typing import NDArray
from shapely import from_geojson, is_valid_reason, to_wkb, transform
from shapely.errors import GEOSException
from shapely.geometry import box as rectangle
from shapely.geometry.base import BaseGeometry

from trigpoint.errors import InputError
from trigpoint.landmarks.conditions import (
    AllOf,
    Always,
    AnyOf,
    ArithmeticOperator,
    Calculated,
    Compared,
    CompareOperator,
    Condition,
    Given,
    Like,
    Located,
    LowerCase,
    Missing,
    NoneOf,
    OfFeature,
    Operand,
    SpatialRelation,
)
from trigpoint.landmarks.layers import Layer
from trigpoint.landmarks.queries import LAT_LIMIT_DEG, LON_LIMIT_DEG, DegreeBox

TEXT_LIMIT = 16_384  # characters
DEPTH_LIMIT = 64  # of brackets in one another; the parser's own stack ends at about 2 000
GEOMETRY = "geometry"  # the name of a feature's geometry
WHOLE_LIMIT = 2**63
COMPARE: frozenset[str] = frozenset(get_args(CompareOperator))
ARITHMETIC: frozenset[str] = frozenset(get_args(ArithmeticOperator))
RELATIONS: dict[str, SpatialRelation] = {f"s_{name}": name for name in get_args(SpatialRelation)}
TURNED: dict[SpatialRelation, SpatialRelation] = {"contains": "within", "within": "contains"}
KINDS_OF_GEOMETRY = frozenset({"Point", "MultiPoint", "LineString", "MultiLineString", "Polygon", "MultiPolygon"})
STRING = re.compile(r"'(?:[^']|'')*'|\"[^\"]*\"")
DEEPENING = re.compile(r"[(\[{]|\bnot\b|[-+](?=\s*[-+])|\^", re.IGNORECASE)
CLOSING = re.compile(r"[)\]}]")

Degrees = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Coordinates (n, 2) of a filter's geometries, in the order they stand there, as longitudes and latitudes (n, 2)."""


def as_they_are(coordinates: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coordinates that are longitude and latitude already."""
    return coordinates


def condition_from_text(text: str, layer: Layer, degrees: Degrees = as_they_are) -> Condition:
    """The condition of a CQL2 text. Raises InputError for one that is none, or says nothing of the layer."""
    return _Reading(layer, degrees).condition(_tree_of(text))


def condition_from_json(text: str, layer: Layer, degrees: Degrees = as_they_are) -> Condition:
    """The condition of CQL2 in JSON. Raises as `condition_from_text`."""
    if len(text) > TEXT_LIMIT:
        raise InputError(f"filter of {len(text)} characters: at most {TEXT_LIMIT}")
    try:
        tree = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"filter is no JSON: {error}") from error
    return _Reading(layer, degrees).condition(tree)


@lru_cache(maxsize=256)
def _tree_of(text: str) -> Any:
    """The text as CQL2's JSON; what would exhaust the parser's stack is refused before."""
    if len(text) > TEXT_LIMIT:
        raise InputError(f"filter of {len(text)} characters: at most {TEXT_LIMIT}")
    outside = STRING.sub("0", text)
    if _depth(outside) > DEPTH_LIMIT:
        raise InputError(f"filter is nested deeper than {DEPTH_LIMIT}")
    try:
        return cql2.parse_text(text).to_json()
    except (cql2.ParseError, cql2.ValidationError, ValueError) as error:
        raise InputError(f"filter is no CQL2: {' '.join(str(error).split())[:200]}") from error


def _depth(text: str) -> int:
    """How many brackets, negations and signs stand in one another at most; what is beside one another adds up too."""
    deepest = depth = 0
    for token in re.finditer(f"{DEEPENING.pattern}|{CLOSING.pattern}", text, re.IGNORECASE):
        depth += -1 if token.group() in ")]}" else 1
        deepest = max(deepest, depth)
    return deepest


class _Reading:
    """One filter read for one layer."""

    def __init__(self, layer: Layer, degrees: Degrees) -> None:
        self._layer, self._degrees = layer, degrees
        self._depth = 0

    def condition(self, node: Any) -> Condition:
        """The condition of a node."""
        self._depth += 1
        if self._depth > DEPTH_LIMIT:
            raise InputError(f"filter is nested deeper than {DEPTH_LIMIT}")
        found = Always(node) if isinstance(node, bool) else self._of_operation(node)
        self._depth -= 1
        return found

    def _of_operation(self, node: Any) -> Condition:
        if isinstance(node, dict) and "property" in node:
            return self._compared("=", [node, True])
        if not isinstance(node, dict) or not isinstance(node.get("op"), str) or not isinstance(node.get("args"), list):
            raise InputError(f"{_shown(node)} is no condition")
        operation, arguments = node["op"], node["args"]
        if operation in ("and", "or"):
            parts = tuple(map(self.condition, arguments))
            if not parts:
                raise InputError(f"{operation!r} has no arguments")
            return AllOf(parts) if operation == "and" else AnyOf(parts)
        if operation in COMPARE:
            return self._compared(operation, arguments)
        if operation in RELATIONS:
            return self._located(RELATIONS[operation], *_counted(operation, arguments, 2))
        return self._of_word(operation, arguments)

    def _of_word(self, operation: str, arguments: list[Any]) -> Condition:
        match operation:
            case "not":
                return NoneOf(self.condition(*_counted(operation, arguments, 1)))
            case "isNull":
                return Missing(self._of_feature(*_counted(operation, arguments, 1)))
            case "like":
                return self._like(*_counted(operation, arguments, 2))
            case "between":
                value, low, high = _counted(operation, arguments, 3)
                return AllOf((self._compared(">=", [value, low]), self._compared("<=", [value, high])))
            case "in":
                value, options = _counted(operation, arguments, 2)
                if not isinstance(options, list) or not options:
                    raise InputError("'in' needs a list of values")
                return AnyOf(tuple(self._compared("=", [value, option]) for option in options))
            case _:
                raise InputError(f"{operation[:40]!r} is no operation known here")

    def _compared(self, operator: Any, arguments: list[Any]) -> Compared:
        left, right = map(self._operand, _counted(operator, arguments, 2))
        if left.kind != right.kind:
            raise InputError(f"{operator!r} compares a {left.kind} with a {right.kind}")
        if left.kind == "boolean" and operator not in ("=", "<>"):
            raise InputError(f"{operator!r} has no meaning for booleans")
        return Compared(operator, left, right)

    def _operand(self, node: Any) -> Operand:
        if isinstance(node, str | int | float):
            return Given(_checked(node))
        if isinstance(node, dict) and "property" in node:
            return self._of_feature(node)
        if isinstance(node, dict) and isinstance(node.get("args"), list):
            return self._calculated(node.get("op"), node["args"])
        raise InputError(f"{_shown(node)} is no value that can be compared")

    def _calculated(self, operation: Any, arguments: list[Any]) -> Operand:
        self._depth += 1
        if self._depth > DEPTH_LIMIT:
            raise InputError(f"filter is nested deeper than {DEPTH_LIMIT}")
        if operation == "casei":
            (text,) = map(self._operand, _counted(operation, arguments, 1))
            found: Operand = LowerCase(_of_kind("string", text, operation))
        elif operation in ARITHMETIC:
            left, right = map(self._operand, _counted(operation, arguments, 2))
            found = Calculated(operation, _of_kind("number", left, operation), _of_kind("number", right, operation))
        else:
            raise InputError(f"{_shown(operation)} is no function known here")
        self._depth -= 1
        return found

    def _of_feature(self, node: Any) -> OfFeature:
        name = node.get("property") if isinstance(node, dict) else None
        found = self._layer.property_named(name) if isinstance(name, str) else None
        if found is None or not found.comparable:
            there = ", ".join(one.name for one in self._layer.properties if one.comparable)
            raise InputError(f"{_shown(name)} is no queryable of {self._layer.name}: there are {there}")
        return OfFeature(found)

    def _like(self, value: Any, pattern: Any) -> Like:
        any_case = isinstance(pattern, dict) and pattern.get("op") == "casei" and isinstance(pattern.get("args"), list)
        if any_case:
            (pattern,) = _counted("casei", pattern["args"], 1)
        if not isinstance(pattern, str):
            raise InputError(f"'like' needs a pattern, not {_shown(pattern)}")
        if (len(pattern) - len(pattern.rstrip("\\"))) % 2:
            raise InputError(f"pattern {pattern[:40]!r} ends in a backslash")
        text = _of_kind("string", self._operand(value), "like")
        return Like(text, str(_checked(pattern)), any_case=any_case)

    def _located(self, relation: SpatialRelation, left: Any, right: Any) -> Located:
        if not self._layer.geometry:
            raise InputError(f"features of {self._layer.name} have no geometry")
        if right == {"property": GEOMETRY} and left != right:
            left, right, relation = right, left, TURNED.get(relation, relation)
        if left != {"property": GEOMETRY}:
            raise InputError(f"a spatial condition relates the property {GEOMETRY!r} to a geometry")
        shape = self._shape(right)
        lon_min_deg, lat_min_deg, lon_max_deg, lat_max_deg = shape.bounds
        box = DegreeBox(
            lon_min_deg=lon_min_deg, lat_min_deg=lat_min_deg, lon_max_deg=lon_max_deg, lat_max_deg=lat_max_deg
        )
        return Located(relation, to_wkb(shape), box)

    def _shape(self, node: Any) -> BaseGeometry:
        """The geometry in longitudes and latitudes."""
        if not isinstance(node, dict):
            raise InputError(f"{_shown(node)} is no geometry")
        stated = _box_shape(node["bbox"]) if "bbox" in node else _geojson_shape(node)
        shape = transform(stated, self._degrees)
        limits = (-LON_LIMIT_DEG, -LAT_LIMIT_DEG, LON_LIMIT_DEG, LAT_LIMIT_DEG)
        if not rectangle(*limits).covers(rectangle(*shape.bounds)):
            raise InputError(f"a geometry reaches from {shape.bounds[:2]} to {shape.bounds[2:]}, beyond the globe")
        return shape


def _box_shape(bounds: Any) -> BaseGeometry:
    if not isinstance(bounds, list) or len(bounds) not in (4, 6):
        raise InputError("a bbox has 4 or 6 numbers")
    numbers = [_number(one) for one in bounds]
    half = len(numbers) // 2
    return rectangle(numbers[0], numbers[1], numbers[half], numbers[half + 1])


def _geojson_shape(node: dict[str, Any]) -> BaseGeometry:
    if node.get("type") not in KINDS_OF_GEOMETRY:
        raise InputError(f"{_shown(node)} is no geometry of those known here: {', '.join(sorted(KINDS_OF_GEOMETRY))}")
    try:
        shape = from_geojson(json.dumps({"type": node["type"], "coordinates": node.get("coordinates")}))
    except (GEOSException, ValueError, RecursionError) as error:
        raise InputError(f"{_shown(node)} is no geometry: {error}") from error
    if shape.is_empty or not all(math.isfinite(bound) for bound in shape.bounds):
        raise InputError(f"{_shown(node)} has no extent")
    if not shape.is_valid:
        raise InputError(f"{_shown(node)} is not valid: {is_valid_reason(shape)}")
    return shape


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{_shown(value)} is no number")
    return float(_checked(value))


def _checked(value: str | int | float) -> str | int | float | bool:
    """A value every database can hold; a number without fraction as a whole one, which loses nothing."""
    if isinstance(value, bool):
        return value
    if isinstance(value, str):
        if any(character == "\0" or "\ud800" <= character <= "\udfff" for character in value):
            raise InputError(f"{value[:40]!r} holds a character that no database keeps")
        return value
    if isinstance(value, float) and not math.isfinite(value):
        raise InputError(f"{value} is not finite")
    if abs(value) < WHOLE_LIMIT:
        return int(value) if value == int(value) else value
    if abs(value) > 1e300:
        raise InputError(f"a number of {len(str(value))} characters is too large")
    return float(value)


def _of_kind(kind: str, operand: Operand, operation: str) -> Operand:
    if operand.kind != kind:
        raise InputError(f"{operation!r} needs a {kind}, not a {operand.kind}")
    return operand


def _counted(operation: str, arguments: list[Any], count: int) -> list[Any]:
    if len(arguments) != count:
        raise InputError(f"{operation!r} has {len(arguments)} arguments: {count} are needed")
    return arguments


def _shown(node: Any) -> str:
    """The beginning of a node as JSON."""
    try:
        text = json.dumps(node)
    except RecursionError:
        return "what is nested so deeply"
    return text if len(text) <= 60 else f"{text[:60]}…"
