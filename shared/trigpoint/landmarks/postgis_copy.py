"""Rows copied into tables of a PostgreSQL server in its binary form: many times faster than statements."""

from collections.abc import Iterable, Sequence
from typing import Any, cast

import psycopg
from psycopg import sql
from sqlalchemy import BigInteger, Boolean, Column, Double, Table, Text

from trigpoint.landmarks import records, tables
from trigpoint.landmarks.geopackage_geometry import Coordinates
from trigpoint.landmarks.model import Landmark
from trigpoint.landmarks.postgis_geometry import encoded
from trigpoint.landmarks.postgis_rows import BEGINNING, END, binary_rows

Driver = psycopg.Connection[tuple[object, ...]]

TYPE_NAMES = {BigInteger: "int8", Boolean: "bool", Double: "float8", Text: "text", tables.LandmarkGeometry: "bytea"}
ROWS_AT_ONCE = 4096  # are made ready: some megabytes


def copy_landmarks(driver: Driver, target: Table, landmarks: Sequence[Landmark], *, srs_id: int) -> None:
    """The landmarks appended to `landmarks` or `landmark_history`."""
    with driver.cursor() as cursor, cursor.copy(_statement(target)) as copy:
        copy.write(BEGINNING)
        for first in range(0, len(landmarks), ROWS_AT_ONCE):
            copy.write(binary_rows(landmarks[first : first + ROWS_AT_ONCE], srs_id=srs_id))
        copy.write(END)


def copy_records(driver: Driver, target: Table, rows: Sequence[records.Record]) -> None:
    """The records appended to a table, geometries as (srs id, coordinates)."""
    names = [column.name for column in target.columns if column.name != "fid"]
    copy_rows(driver, target, (tuple(_plain(name, row[name]) for name in names) for row in rows))


def copy_rows(driver: Driver, target: Table, rows: Iterable[Sequence[object]]) -> None:
    """The rows appended to a table: values of all columns in order, but the feature id; geometries as EWKB."""
    with driver.cursor() as cursor, cursor.copy(_statement(target)) as copy:
        copy.set_types([TYPE_NAMES[type(column.type)] for column in _columns(target)])
        for row in rows:
            copy.write_row(row)


def _statement(target: Table) -> sql.Composed:
    names = sql.SQL(", ").join(sql.Identifier(column.name) for column in _columns(target))
    return sql.SQL("COPY {} ({}) FROM STDIN (FORMAT binary)").format(sql.Identifier(target.name), names)


def _columns(target: Table) -> list[Column[Any]]:
    """All but the feature id."""
    return [column for column in target.columns if column.name != "fid"]


def _plain(name: str, value: object) -> object:
    if name != "geom" or value is None:
        return value
    srs_id, points = cast(tuple[int, Coordinates], value)
    return encoded(points, srs_id=srs_id)
