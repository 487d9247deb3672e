"""Kinds of values with their limits, for the fields of settings."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

Seconds = Annotated[float, Field(gt=0.0, le=86_400.0, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Probability = Annotated[float, Field(gt=0.0, lt=1.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=1)]
Port = Annotated[int, Field(ge=0, le=65_535)]
Name = Annotated[str, Field(min_length=1, max_length=60)]


@dataclass(frozen=True, slots=True)
class SetElsewhere:
    """Fields of a section that another section's key sets, as pairs of a field and "section.key"."""

    fields: tuple[tuple[str, str], ...]
