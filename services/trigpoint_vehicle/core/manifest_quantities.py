"""How a manifest names a quantity: a column or a fixed value, with its unit."""

import math
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, ConfigDict, model_validator

from trigpoint_vehicle.core.text_tables import TextTable

Floats = NDArray[np.float64]

FOOT_M = 0.3048
MILE_M = 1609.344
NAUTICAL_MILE_M = 1852.0
STANDARD_GRAVITY_MPS2 = 9.80665


class ManifestPart(BaseModel):
    """A part of a manifest; keys it does not know are refused, and numbers that are not finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Quantity(ManifestPart):
    """A number for each row: a column's cells or `value`, then times `factor` and plus `offset`, in `unit`."""

    SI_PER_UNIT: ClassVar[dict[str, float]] = {}

    column: str | None = None
    value: float | None = None
    unit: str
    factor: float = 1.0
    offset: float = 0.0

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.column is None) == (self.value is None):
            raise ValueError("give either a column or a value")
        return self

    def of(self, table: TextTable) -> Floats:
        """The quantity (n,) in metres, radians, seconds and what they make. Raises InputError naming the cell."""
        raw = np.full(len(table.line_number), self.value) if self.column is None else table.numbers(self.column)
        numbers: Floats = (raw * self.factor + self.offset) * self.SI_PER_UNIT[self.unit]
        return numbers


class Length(Quantity):
    """A length in metres."""

    SI_PER_UNIT = {"m": 1.0, "km": 1000.0, "cm": 0.01, "mm": 0.001, "ft": FOOT_M}
    unit: Literal["m", "km", "cm", "mm", "ft"] = "m"


class Angle(Quantity):
    """An angle in radians."""

    SI_PER_UNIT = {"rad": 1.0, "deg": math.pi / 180.0}
    unit: Literal["rad", "deg"] = "rad"


class Degrees(Quantity):
    """A latitude or longitude; its column is in degrees unless said otherwise. In degrees."""

    SI_PER_UNIT = {"deg": 1.0, "rad": 180.0 / math.pi}
    unit: Literal["deg", "rad"] = "deg"


class Speed(Quantity):
    """A speed in metres a second."""

    SI_PER_UNIT = {"m/s": 1.0, "km/h": 1.0 / 3.6, "mph": MILE_M / 3600.0, "kn": NAUTICAL_MILE_M / 3600.0}
    unit: Literal["m/s", "km/h", "mph", "kn"] = "m/s"


class TurnRate(Quantity):
    """A rate of turn in radians a second."""

    SI_PER_UNIT = {"rad/s": 1.0, "deg/s": math.pi / 180.0}
    unit: Literal["rad/s", "deg/s"] = "rad/s"


class Acceleration(Quantity):
    """An acceleration in metres a second squared."""

    SI_PER_UNIT = {"m/s2": 1.0, "g": STANDARD_GRAVITY_MPS2}
    unit: Literal["m/s2", "g"] = "m/s2"


class Words(ManifestPart):
    """A text for each row: a column's cells or one `value`, after `prefix`."""

    column: str | None = None
    value: str | None = None
    prefix: str = ""

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.column is None) == (self.value is None):
            raise ValueError("give either a column or a value")
        return self

    def of(self, table: TextTable) -> tuple[str, ...]:
        """The texts (n,); empty cells stay empty, without the prefix. Raises InputError for an unknown column."""
        if self.column is None:
            return (self.prefix + (self.value or ""),) * len(table.line_number)
        return tuple(self.prefix + text if text else "" for text in table.texts(self.column))


def _quantity(given: object) -> object:
    if isinstance(given, str):
        return {"column": given}
    if isinstance(given, int | float) and not isinstance(given, bool):
        return {"value": given}
    return given


def _words(given: object) -> object:
    return {"column": given} if isinstance(given, str) else given


# In a manifest a bare text names a column, a bare number is the value itself.
AsLength = Annotated[Length, BeforeValidator(_quantity)]
AsAngle = Annotated[Angle, BeforeValidator(_quantity)]
AsDegrees = Annotated[Degrees, BeforeValidator(_quantity)]
AsSpeed = Annotated[Speed, BeforeValidator(_quantity)]
AsTurnRate = Annotated[TurnRate, BeforeValidator(_quantity)]
AsAcceleration = Annotated[Acceleration, BeforeValidator(_quantity)]
AsWords = Annotated[Words, BeforeValidator(_words)]
