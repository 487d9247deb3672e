"""Whether a feature meets a condition, worked out in Python by SQL's logic: of what is missing nothing is known."""

import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import shapely
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

Values = Callable[[str], Any]
"""The value of a property by its name."""

COMPARING: Mapping[CompareOperator, Callable[[Any, Any], bool]] = {
    "=": operator.eq,
    "<>": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
    "<=": operator.le,
    ">=": operator.ge,
}
CALCULATING: Mapping[ArithmeticOperator, Callable[[float, float], float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}
RELATING: Mapping[SpatialRelation, Callable[[BaseGeometry, BaseGeometry], np.bool_]] = {
    "intersects": shapely.intersects,
    "disjoint": shapely.disjoint,
    "contains": shapely.contains,
    "within": shapely.within,
    "touches": shapely.touches,
    "crosses": shapely.crosses,
    "overlaps": shapely.overlaps,
    "equals": shapely.equals,
}


def meets(condition: Condition | None, values: Values, shape: Callable[[], BaseGeometry | None]) -> bool:
    """Whether a feature of these values meets the condition; `shape` gives its geometry in longitudes and latitudes.

    Raises InputError for a number that comes out too large.
    """
    return condition is None or _truth(condition, values, shape) is True


def _truth(condition: Condition, values: Values, shape: Callable[[], BaseGeometry | None]) -> bool | None:
    """True, False, or None where it is not known."""
    match condition:
        case Always(value):
            return value
        case AllOf(parts):
            return _all_of([_truth(part, values, shape) for part in parts])
        case AnyOf(parts):
            return _negated(_all_of([_negated(_truth(part, values, shape)) for part in parts]))
        case NoneOf(part):
            return _negated(_truth(part, values, shape))
        case Compared(compare, left, right):
            return _compared(compare, _value(left, values), _value(right, values))
        case Like():
            return _like(condition, _value(condition.text, values))
        case Missing(of):
            return values(of.of.name) is None
        case Located(relation, wkb, _):
            own = shape()
            return None if own is None else bool(RELATING[relation](own, _other(wkb)))


def _all_of(parts: list[bool | None]) -> bool | None:
    if False in parts:
        return False
    return None if None in parts else True


def _negated(truth: bool | None) -> bool | None:
    return None if truth is None else not truth


def _compared(compare: CompareOperator, left: Any, right: Any) -> bool | None:
    return None if left is None or right is None else COMPARING[compare](left, right)


def _like(condition: Like, text: Any) -> bool | None:
    if text is None:
        return None
    pattern, text = (condition.pattern.lower(), text.lower()) if condition.any_case else (condition.pattern, text)
    first, *others = _pieces(pattern)
    if not others:
        return first.pattern.fullmatch(text) is not None
    found = first.pattern.match(text)
    for piece in others[:-1]:
        found = piece.pattern.search(text, found.end()) if found else None
    end = len(text) - others[-1].length
    return found is not None and end >= found.end() and others[-1].pattern.fullmatch(text, end) is not None


@dataclass(frozen=True, slots=True)
class _Piece:
    """What stands between two % of a pattern: it matches texts of one length."""

    pattern: re.Pattern[str]
    length: int


@lru_cache(maxsize=256)
def _pieces(pattern: str) -> tuple[_Piece, ...]:
    """SQL's pattern piece by piece: as one regular expression it could take for ever."""
    pieces: list[list[str]] = [[]]
    for token in re.findall(r"\\.|[^\\]", pattern, re.DOTALL):
        if token == "%":
            pieces.append([])
        else:
            pieces[-1].append("." if token == "_" else re.escape(token[-1]))
    return tuple(_Piece(re.compile("".join(tokens), re.DOTALL), len(tokens)) for tokens in pieces)


@lru_cache(maxsize=64)
def _other(wkb: bytes) -> BaseGeometry:
    shape = shapely.from_wkb(wkb)
    shapely.prepare(shape)
    return shape


def _value(operand: Operand, values: Values) -> Any:
    match operand:
        case Given(value):
            return value
        case OfFeature(of):
            return values(of.name)
        case LowerCase(text):
            value = _value(text, values)
            return None if value is None else value.lower()
        case Calculated(calculate, left, right):
            return _calculated(calculate, _value(left, values), _value(right, values))


def _calculated(calculate: ArithmeticOperator, left: float | None, right: float | None) -> float | None:
    if left is None or right is None or (calculate == "/" and right == 0.0):
        return None
    result = CALCULATING[calculate](float(left), float(right))
    if not math.isfinite(result):
        raise InputError(f"{left} {calculate} {right} is out of range")
    return result
