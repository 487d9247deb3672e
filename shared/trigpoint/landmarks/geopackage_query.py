"""Landmark queries as SQL on a GeoPackage: the area by its spatial index, everything else by columns."""

import json
import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from sqlalchemy import Column, ColumnElement, Table, bindparam, column, func, literal_column, or_, select, table
from sqlalchemy.dialects import sqlite
from sqlalchemy.sql.base import ReadOnlyColumnCollection

from trigpoint.geodesy.projection import WGS84, transform_coordinates
from trigpoint.landmarks import tables
from trigpoint.landmarks.geopackage_schema import rtree_name
from trigpoint.landmarks.queries import DegreeBox, LandmarkQuery

EDGE_SHARE = np.linspace(0.0, 1.0, 5)  # an edge of a degree box is a curve on the grid: taken at these places
EDGE_LON_SHARE = np.concatenate([EDGE_SHARE, EDGE_SHARE, np.zeros(5), np.ones(5)])
EDGE_LAT_SHARE = np.concatenate([np.zeros(5), np.ones(5), EDGE_SHARE, EDGE_SHARE])
WINDOW_MARGIN = 0.01  # of the window's size: an edge of a degree bulges 15 m between two places at 45 degrees
WINDOW_MARGIN_M = 1.0  # the index keeps float32, rounded outwards, so no point is lost to rounding
WIDEST_INDEXED_DEG = 5.0  # a map wider than that, or across the antimeridian, is searched without the index

Columns = ReadOnlyColumnCollection[str, Column[Any]]

LANDMARK_TABLES = (tables.landmarks, tables.landmark_history)
EXTENT_SQL = "SELECT min(lon_deg), min(lat_deg), max(lon_deg), max(lat_deg) FROM {table}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Validity:
    """Which rows are asked for by version: valid at one, opened after one, ended by one; None: any."""

    valid_at: int | None = None
    opened_after: int | None = None
    ended_by: int | None = None


ANY_ROW = Validity()


@dataclass(frozen=True, slots=True, kw_only=True)
class QueryShape:
    """Which conditions a query has, of `kinds` how many; the values are bound when it is run."""

    windowed: bool = False
    boxed: bool = False
    kinds: int = 0
    certain: bool = False
    vehicle: bool = False
    seen: bool = False
    valid_at: bool = False
    opened_after: bool = False
    ended_by: bool = False
    after: bool = False
    limited: bool = False


def query_shape(query: LandmarkQuery, validity: Validity, *, windowed: bool, boxed: bool) -> QueryShape:
    """The shape of a query for rows of a validity."""
    by_id = not query.by_distance
    return QueryShape(
        windowed=windowed,
        boxed=boxed,
        kinds=len(query.kinds),
        certain=query.max_sigma_m is not None,
        vehicle=query.vehicle is not None,
        seen=query.seen is not None,
        valid_at=validity.valid_at is not None,
        opened_after=validity.opened_after is not None,
        ended_by=validity.ended_by is not None,
        after=query.after is not None and by_id,
        limited=is_limited_by_id(query),
    )


def is_limited_by_id(query: LandmarkQuery) -> bool:
    """Whether the first rows in order of id are sure to be the answer: every condition is checked by the database."""
    return query.limit is not None and not query.by_distance and query.vehicle is None


def vehicle_item(vehicle: str) -> str:
    """What a list of vehicles holds as text if the vehicle is in it, and hardly ever else."""
    return json.dumps(vehicle, ensure_ascii=False)


def bound_values(query: LandmarkQuery, validity: Validity) -> dict[str, object]:
    """A query's values under the names the SQL binds them by, the area's left out."""
    seen = query.seen
    return {
        **{f"kind_{number}": kind for number, kind in enumerate(query.kinds)},
        "max_sigma_m": query.max_sigma_m,
        "vehicle": None if query.vehicle is None else vehicle_item(query.vehicle),
        "seen_first_ns": None if seen is None else seen.first_ns,
        "seen_last_ns": None if seen is None else seen.last_ns,
        "valid_at": validity.valid_at,
        "opened_after": validity.opened_after,
        "ended_by": validity.ended_by,
        "after": None if query.after is None else query.after.landmark,
        "limit": query.limit,
    }


@dataclass(frozen=True, slots=True)
class MapExtent:
    """Where all landmarks lie, and in which CRS the grid is."""

    box: DegreeBox
    crs: str


def grid_window(box: DegreeBox, crs: str) -> dict[str, float]:
    """A window of the map's grid that holds the whole box: window_min_x and so on, in metres."""
    lon_deg = box.lon_min_deg + (box.lon_max_deg - box.lon_min_deg) * EDGE_LON_SHARE
    lat_deg = box.lat_min_deg + (box.lat_max_deg - box.lat_min_deg) * EDGE_LAT_SHARE
    x_m, y_m = transform_coordinates(lon_deg, lat_deg, source_crs=WGS84, target_crs=crs)
    x, y = x_m.tolist(), y_m.tolist()
    min_x, max_x, min_y, max_y = min(x), max(x), min(y), max(y)
    margin_m = WINDOW_MARGIN_M + WINDOW_MARGIN * max(max_x - min_x, max_y - min_y)
    return {
        "window_min_x": min_x - margin_m,
        "window_max_x": max_x + margin_m,
        "window_min_y": min_y - margin_m,
        "window_max_y": max_y + margin_m,
    }


def held_extent(driver: sqlite3.Connection) -> MapExtent | None:
    """The extent of all landmarks of all versions; None while there is none."""
    boxes = [driver.execute(EXTENT_SQL.format(table=source.name)).fetchone() for source in LANDMARK_TABLES]
    held = [box for box in boxes if box[0] is not None]
    if not held:
        return None
    (crs,) = driver.execute("SELECT crs FROM map_versions").fetchone()
    box = DegreeBox(
        lon_min_deg=min(box[0] for box in held),
        lat_min_deg=min(box[1] for box in held),
        lon_max_deg=max(box[2] for box in held),
        lat_max_deg=max(box[3] for box in held),
    )
    return MapExtent(box, crs)


def clipped(box: DegreeBox, extent: DegreeBox) -> DegreeBox | None:
    """The part of a box inside an extent, None if they do not meet."""
    lon_min_deg, lon_max_deg = max(box.lon_min_deg, extent.lon_min_deg), min(box.lon_max_deg, extent.lon_max_deg)
    lat_min_deg, lat_max_deg = max(box.lat_min_deg, extent.lat_min_deg), min(box.lat_max_deg, extent.lat_max_deg)
    if lon_min_deg > lon_max_deg or lat_min_deg > lat_max_deg:
        return None
    return DegreeBox(lon_min_deg=lon_min_deg, lat_min_deg=lat_min_deg, lon_max_deg=lon_max_deg, lat_max_deg=lat_max_deg)


def bound_box(box: DegreeBox) -> dict[str, float]:
    """A box's values under the names the SQL binds them by."""
    return {
        "lon_min": box.lon_min_deg,
        "lat_min": box.lat_min_deg,
        "lon_max": box.lon_max_deg,
        "lat_max": box.lat_max_deg,
    }


@lru_cache(maxsize=256)
def landmark_sql(source: Table, shape: QueryShape) -> str:
    """The SQL text of a query of one shape on `landmarks` or `landmark_history`, with named parameters."""
    columns = source.c
    statement = select(*(item for item in columns if item.name != "fid"))
    if shape.windowed:
        index = table(rtree_name(source.name), *(column(name) for name in ("id", "minx", "maxx", "miny", "maxy")))
        inside = (
            (index.c.maxx >= bindparam("window_min_x"))
            & (index.c.minx <= bindparam("window_max_x"))
            & (index.c.maxy >= bindparam("window_min_y"))
            & (index.c.miny <= bindparam("window_max_y"))
        )
        statement = statement.where(columns.fid.in_(select(index.c.id).where(inside)))
    if shape.boxed:
        statement = statement.where(columns.lat_deg.between(bindparam("lat_min"), bindparam("lat_max")))
        statement = statement.where(columns.lon_deg.between(bindparam("lon_min"), bindparam("lon_max")))
    statement = statement.where(*_column_conditions(columns, shape))
    if shape.limited:
        statement = statement.order_by(columns.landmark)
    sql = str(statement.compile(dialect=sqlite.dialect(paramstyle="named")))
    return f"{sql} LIMIT :limit" if shape.limited else sql


def _column_conditions(columns: Columns, shape: QueryShape) -> Iterator[ColumnElement[bool]]:
    """What a shape asks of the columns, the area left out."""
    ends = columns.valid_to_version
    if shape.kinds:
        yield columns.kind.in_([bindparam(f"kind_{number}") for number in range(shape.kinds)])
    if shape.certain:
        yield columns.sigma_major_m <= bindparam("max_sigma_m")
    if shape.vehicle:
        yield func.instr(columns.vehicles, bindparam("vehicle")) > literal_column("0")
    if shape.seen:
        yield columns.first_seen_ns <= bindparam("seen_last_ns")
        yield columns.last_seen_ns >= bindparam("seen_first_ns")
    if shape.valid_at:
        yield columns.valid_from_version <= bindparam("valid_at")
        yield or_(ends.is_(None), ends > bindparam("valid_at"))
    if shape.opened_after:
        yield columns.valid_from_version > bindparam("opened_after")
    if shape.ended_by:
        yield ends <= bindparam("ended_by")
    if shape.after:
        yield columns.landmark > bindparam("after")
