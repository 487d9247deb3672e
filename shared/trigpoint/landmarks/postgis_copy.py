"""Rows copied into tables of a PostgreSQL server in its binary form: many times faster than statements."""

from collections.abc import Iterable, Sequence
from typing import cast

import psycopg
from psycopg import sql
from sqlalchemy import BigInteger, Boolean, Double, Table, Text

from trigpoint.landmarks import records, tables
from trigpoint.landmarks.geopackage_geometry import Coordinates
from trigpoint.landmarks.landmark_record import record_of
from trigpoint.landmarks.model import Landmark
from trigpoint.landmarks.postgis_geometry import encoded, encoded_point

Driver = psycopg.Connection[tuple[object, ...]]

TYPE_NAMES = {BigInteger: "int8", Boolean: "bool", Double: "float8", Text: "text", tables.LandmarkGeometry: "bytea"}


def copy_landmarks(driver: Driver, target: Table, landmarks: Iterable[Landmark], *, srs_id: int) -> None:
    """The landmarks appended to `landmarks` or `landmark_history`."""
    copy_rows(
        driver,
        target,
        (record_of(row, encoded_point(row.easting_m, row.northing_m, srs_id=srs_id)) for row in landmarks),
    )


def copy_records(driver: Driver, target: Table, rows: Sequence[records.Record]) -> None:
    """The records appended to a table, geometries as (srs id, coordinates)."""
    names = [column.name for column in target.columns if column.name != "fid"]
    copy_rows(driver, target, (tuple(_plain(name, row[name]) for name in names) for row in rows))


def copy_rows(driver: Driver, target: Table, rows: Iterable[Sequence[object]]) -> None:
    """The rows appended to a table: values of all columns in order, but the feature id; geometries as EWKB."""
    columns = [column for column in target.columns if column.name != "fid"]
    names = sql.SQL(", ").join(sql.Identifier(column.name) for column in columns)
    statement = sql.SQL("COPY {} ({}) FROM STDIN (FORMAT binary)").format(sql.Identifier(target.name), names)
    with driver.cursor() as cursor, cursor.copy(statement) as copy:
        copy.set_types([TYPE_NAMES[type(column.type)] for column in columns])
        for row in rows:
            copy.write_row(row)


def _plain(name: str, value: object) -> object:
    if name != "geom" or value is None:
        return value
    srs_id, points = cast(tuple[int, Coordinates], value)
    return encoded(points, srs_id=srs_id)
