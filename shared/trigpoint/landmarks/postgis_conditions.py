"""Conditions as SQL of PostGIS: every value bound, no text of a caller's ever part of a statement."""

from collections.abc import Mapping
from typing import Any

from trigpoint.landmarks.conditions import (
    AllOf,
    Always,
    AnyOf,
    Calculated,
    Compared,
    Condition,
    Given,
    Like,
    Located,
    LowerCase,
    Missing,
    NoneOf,
    OfFeature,
    Operand,
)

ANY_CASE = 'COLLATE "und-x-icu"'  # knows the letters of every language, whatever the database's own locale
BY_NUMBER = 'COLLATE "C"'  # in order of the characters' numbers


class BoundValues:
    """The values of a statement, each under a name it is bound by."""

    def __init__(self) -> None:
        self.by_name: dict[str, Any] = {}

    def bound(self, value: Any) -> str:
        """The placeholder of a value from now on."""
        name = f"v{len(self.by_name)}"
        self.by_name[name] = value
        return f"%({name})s"


def condition_sql(condition: Condition, columns: Mapping[str, str], geometry: str, values: BoundValues) -> str:
    """The condition as SQL. `columns`: the expression of each property; `geometry`: of a feature's in EPSG:4326."""
    return _Writing(columns, geometry, values).condition(condition)


class _Writing:
    def __init__(self, columns: Mapping[str, str], geometry: str, values: BoundValues) -> None:
        self._columns, self._geometry, self._values = columns, geometry, values

    def condition(self, condition: Condition) -> str:
        match condition:
            case Always(value):
                return "TRUE" if value else "FALSE"
            case AllOf(parts):
                return f"({' AND '.join(map(self.condition, parts))})"
            case AnyOf(parts):
                return f"({' OR '.join(map(self.condition, parts))})"
            case NoneOf(part):
                return f"(NOT {self.condition(part)})"
            case Compared(compare, left, right):
                order = f" {BY_NUMBER}" if left.kind == "string" else ""
                return f"({self._operand(left)}{order} {compare} {self._operand(right)}{order})"
            case Like():
                return self._like(condition)
            case Missing(of):
                return f"({self._operand(of)} IS NULL)"
            case Located(relation, wkb, _):
                other = f"ST_GeomFromWKB({self._values.bound(wkb)}, 4326)"
                return f"ST_{relation}({self._geometry}, {other})"

    def _like(self, condition: Like) -> str:
        text, pattern = self._operand(condition.text), self._operand(Given(condition.pattern))
        if condition.any_case:
            text, pattern = f"lower({text} {ANY_CASE})", f"lower({pattern} {ANY_CASE})"
        return f"({text} {BY_NUMBER} LIKE {pattern} {BY_NUMBER})"

    def _operand(self, operand: Operand) -> str:
        match operand:
            case OfFeature(of):
                return self._columns[of.name]
            case Given(value):
                return self._given(value)
            case LowerCase(text):
                return f"lower({self._operand(text)} {ANY_CASE})"
            case Calculated(calculate, left, right):
                divisor = self._operand(right)
                second = f"CAST({divisor} AS double precision)"
                if calculate == "/":
                    second = f"nullif({second}, 0)"
                return f"(CAST({self._operand(left)} AS double precision) {calculate} {second})"

    def _given(self, value: str | int | float | bool) -> str:
        """A value with its type said: the server would guess it from what it is compared with."""
        if isinstance(value, bool):
            return "TRUE" if value else "FALSE"
        kinds = {str: "text", int: "bigint", float: "double precision"}
        return f"CAST({self._values.bound(value)} AS {kinds[type(value)]})"
