"""Landmark queries as SQL on a GeoPackage: the area by its spatial index, everything else by columns."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from sqlalchemy import Table, bindparam, column, or_, select, table
from sqlalchemy.dialects import sqlite

from trigpoint.geodesy.projection import WGS84, transform_coordinates
from trigpoint.landmarks import tables
from trigpoint.landmarks.geopackage_geometry import decoded
from trigpoint.landmarks.geopackage_schema import rtree_name
from trigpoint.landmarks.model import Landmark
from trigpoint.landmarks.queries import DegreeBox
from trigpoint.landmarks.records import names_from_json

EDGE_PIECES = 8  # an edge of a degree box is a curve on the grid: taken at this many places
WINDOW_MARGIN = 0.01  # of the window's size: an edge of a degree bulges 4 m between two of them at 45 degrees
WINDOW_MARGIN_M = 1.0  # the index keeps float32, rounded outwards, so no point is lost to rounding
WIDEST_INDEXED_DEG = 5.0  # a map wider than that, or across the antimeridian, is searched without the index

LandmarkRecord = tuple[
    bytes, str, str, str, float, float, float, float, float, float, float, float, float, float,
    int, str, int, int, int, str, str, int, int | None,
]  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class QueryShape:
    """Which conditions a query has; the values are bound when it is run."""

    windowed: bool = False
    boxed: bool = False
    kind: bool = False
    as_of: bool = False
    limited: bool = False


def grid_window(box: DegreeBox, crs: str) -> dict[str, float]:
    """A window of the map's grid that holds the whole box: window_min_x and so on, in metres."""
    share = np.linspace(0.0, 1.0, EDGE_PIECES + 1)
    low, high = np.zeros_like(share), np.ones_like(share)
    lon_deg = box.lon_min_deg + (box.lon_max_deg - box.lon_min_deg) * np.concatenate([share, share, low, high])
    lat_deg = box.lat_min_deg + (box.lat_max_deg - box.lat_min_deg) * np.concatenate([low, high, share, share])
    x_m, y_m = transform_coordinates(lon_deg, lat_deg, source_crs=WGS84, target_crs=crs)
    min_x, max_x, min_y, max_y = float(x_m.min()), float(x_m.max()), float(y_m.min()), float(y_m.max())
    margin_m = WINDOW_MARGIN_M + WINDOW_MARGIN * max(max_x - min_x, max_y - min_y)
    return {
        "window_min_x": min_x - margin_m,
        "window_max_x": max_x + margin_m,
        "window_min_y": min_y - margin_m,
        "window_max_y": max_y + margin_m,
    }


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
    if shape.kind:
        statement = statement.where(columns.kind == bindparam("kind"))
    if shape.as_of:
        ends = columns.valid_to_version
        statement = statement.where(columns.valid_from_version <= bindparam("as_of"))
        statement = statement.where(or_(ends.is_(None), ends > bindparam("as_of")))
    if shape.limited:
        statement = statement.order_by(columns.landmark).limit(bindparam("limit"))
    return str(statement.compile(dialect=sqlite.dialect(paramstyle="named")))


def landmark_of(record: LandmarkRecord) -> Landmark:
    """The landmark of a record of `landmark_sql`."""
    ((easting_m, northing_m),) = decoded(record[0])
    return Landmark(
        landmark=record[1],
        kind=record[2],
        signature=record[3],
        x_m=record[4],
        y_m=record[5],
        easting_m=easting_m,
        northing_m=northing_m,
        lat_deg=record[6],
        lon_deg=record[7],
        variance_x_m2=record[8],
        covariance_xy_m2=record[9],
        variance_y_m2=record[10],
        sigma_major_m=record[11],
        sigma_minor_m=record[12],
        ellipse_heading_rad=record[13],
        observation_count=record[14],
        vehicles=names_from_json(record[15]),
        first_seen_ns=record[16],
        last_seen_ns=record[17],
        anchored=bool(record[18]),
        anchors=names_from_json(record[19]),
        provenance=record[20],
        valid_from_version=record[21],
        valid_to_version=record[22],
    )


LANDMARK_TABLES = (tables.landmarks, tables.landmark_history)
