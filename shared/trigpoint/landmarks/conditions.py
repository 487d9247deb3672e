"""Conditions on the features of a layer, as values: what a database turns into SQL and Python into an answer."""

from dataclasses import dataclass
from typing import Literal

from trigpoint.landmarks.layers import Property
from trigpoint.landmarks.queries import DegreeBox

CompareOperator = Literal["=", "<>", "<", ">", "<=", ">="]
ArithmeticOperator = Literal["+", "-", "*", "/"]
SpatialRelation = Literal["intersects", "disjoint", "contains", "within", "touches", "crosses", "overlaps", "equals"]
OperandKind = Literal["string", "number", "boolean"]


@dataclass(frozen=True, slots=True)
class OfFeature:
    """The value of a feature's property."""

    of: Property

    @property
    def kind(self) -> OperandKind:
        """What can be compared with it."""
        kind = self.of.kind
        assert kind != "array"
        return "number" if kind == "integer" else kind


@dataclass(frozen=True, slots=True)
class Given:
    """A value that was given; a number is finite."""

    value: str | int | float | bool

    @property
    def kind(self) -> OperandKind:
        """What can be compared with it."""
        if isinstance(self.value, bool):
            return "boolean"
        return "string" if isinstance(self.value, str) else "number"


@dataclass(frozen=True, slots=True)
class LowerCase:
    """A text without regard to upper and lower case."""

    text: "Operand"
    kind: OperandKind = "string"


@dataclass(frozen=True, slots=True)
class Calculated:
    """Two numbers as one; nothing over zero is nothing."""

    operator: ArithmeticOperator
    left: "Operand"
    right: "Operand"
    kind: OperandKind = "number"


Operand = OfFeature | Given | LowerCase | Calculated


@dataclass(frozen=True, slots=True)
class Compared:
    """Two operands of one kind; texts are in order of their characters' numbers."""

    operator: CompareOperator
    left: Operand
    right: Operand


@dataclass(frozen=True, slots=True)
class Like:
    """A text like a pattern: % is anything, _ one character, a backslash takes the next one as it is."""

    text: Operand
    pattern: str
    any_case: bool = False


@dataclass(frozen=True, slots=True)
class Missing:
    """A property without a value."""

    of: OfFeature


@dataclass(frozen=True, slots=True)
class Located:
    """A feature's geometry related to another one, both on the plane of longitudes and latitudes.

    `wkb` is the other one, valid, with `box` around it.
    """

    relation: SpatialRelation
    wkb: bytes
    box: DegreeBox


@dataclass(frozen=True, slots=True)
class Always:
    """The same for every feature."""

    value: bool


@dataclass(frozen=True, slots=True)
class AllOf:
    """Every part holds."""

    parts: "tuple[Condition, ...]"


@dataclass(frozen=True, slots=True)
class AnyOf:
    """One of the parts holds at least."""

    parts: "tuple[Condition, ...]"


@dataclass(frozen=True, slots=True)
class NoneOf:
    """The part does not hold."""

    part: "Condition"


Condition = Compared | Like | Missing | Located | Always | AllOf | AnyOf | NoneOf


def box_of(condition: Condition | None) -> DegreeBox | None:
    """A box outside of which no feature meets the condition, None where nothing bounds it."""
    if isinstance(condition, Located) and condition.relation != "disjoint":
        return condition.box
    if isinstance(condition, AllOf):
        return next((box for box in map(box_of, condition.parts) if box is not None), None)
    return None
