"""A layer's properties as columns of a plain table: what no cell can hold becomes several columns, or JSON text."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from trigpoint.landmarks.geojson import JsonObject
from trigpoint.landmarks.layers import Layer, Property

CellKind = Literal["string", "number", "integer", "boolean"]
Cell = str | float | int | bool | None

COVARIANCE = "covariance_m2"
COVARIANCE_COLUMNS = ("variance_x_m2", "covariance_xy_m2", "variance_y_m2")
JSON_NAMES = {"calibration": "calibration_json"}  # as in the landmark database


@dataclass(frozen=True, slots=True)
class Column:
    """A column; its name ends with its unit, and any of its cells may be empty."""

    name: str
    kind: CellKind
    description: str


def columns_of(layer: Layer) -> tuple[Column, ...]:
    """The columns of a layer, in the order of `cells_of`."""
    return tuple(column for one in layer.properties for column in _columns(one))


def cells_of(layer: Layer, properties: Mapping[str, object]) -> tuple[Cell, ...]:
    """A feature's cells from its GeoJSON properties."""
    cells: list[Cell] = []
    for one in layer.properties:
        value = properties[one.name]
        if one.kind == "array":
            cells += _array_cells(one, value)
        else:
            assert value is None or isinstance(value, str | float | int)
            cells.append(value)
    return tuple(cells)


def _columns(one: Property) -> tuple[Column, ...]:
    if one.name == COVARIANCE:
        east, mixed, north = COVARIANCE_COLUMNS
        return (
            Column(east, "number", "Variance along grid east"),
            Column(mixed, "number", "Covariance of grid east and grid north"),
            Column(north, "number", "Variance along grid north"),
        )
    if one.kind == "array":
        return (Column(JSON_NAMES.get(one.name, one.name), "string", f"{one.description}; a JSON list"),)
    return (Column(one.name, one.kind, one.description),)


def _array_cells(one: Property, value: object) -> tuple[Cell, ...]:
    if one.name != COVARIANCE:
        return (json.dumps(value, ensure_ascii=False),)
    assert isinstance(value, list)
    (variance_x_m2, covariance_xy_m2), (_, variance_y_m2) = value
    return variance_x_m2, covariance_xy_m2, variance_y_m2


def described(columns: tuple[Column, ...]) -> list[JsonObject]:
    """The columns as JSON."""
    return [{"name": one.name, "type": one.kind, "description": one.description} for one in columns]
