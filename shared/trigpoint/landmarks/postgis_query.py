"""Landmark queries as SQL on PostGIS: the area by a spatial index, everything else by columns."""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from geoalchemy2 import Geometry
from sqlalchemy import ColumnElement, Row, Select, Table, func, literal_column, or_, select
from sqlalchemy.types import NullType

from trigpoint.geodesy.projection import WGS84, transform_coordinates
from trigpoint.landmarks import tables
from trigpoint.landmarks.geopackage_query import (
    ANY_ROW,
    WIDEST_INDEXED_DEG,
    Columns,
    Validity,
    grid_window,
    is_limited_by_id,
    vehicle_item,
)
from trigpoint.landmarks.landmark_record import landmark_of
from trigpoint.landmarks.model import Landmark, MapVersion
from trigpoint.landmarks.postgis_schema import server_reference_of
from trigpoint.landmarks.queries import DegreeBox, Disc, LandmarkQuery, area_box

RADIUS_MARGIN_M = 0.01  # the answer's distances are worked out anew: the index only has to miss none
REACH_DEG = 5.0  # boxes this near the map's origin are looked up on its grid; a wider one holds most of the map
WGS84_SRID = 4326


def landmark_statement(
    source: Table, query: LandmarkQuery, *, version: MapVersion, validity: Validity = ANY_ROW
) -> Select[tuple[object, ...]]:
    """The rows of `landmarks` or `landmark_history` of a validity that may meet a query: all that do, and a few that
    nearly do. `version` is any of the map.
    """
    columns = source.c
    fields = [column for column in columns if column.name not in ("fid", "geom")]
    statement = select(func.ST_X(columns.geom), *fields, func.ST_Y(columns.geom))
    box = area_box(query)
    if query.near is not None and source is tables.landmarks:
        statement = statement.where(_within(columns.lon_deg, columns.lat_deg, query.near))
    elif box is not None and _is_near_origin(box, version):
        statement = statement.where(columns.geom.op("&&")(_window(box, version)))
    if box is not None:
        statement = statement.where(columns.lat_deg.between(box.lat_min_deg, box.lat_max_deg))
        statement = statement.where(columns.lon_deg.between(box.lon_min_deg, box.lon_max_deg))
    statement = statement.where(*_column_conditions(columns, query), *_versions(columns, validity))
    if is_limited_by_id(query):
        statement = statement.order_by(columns.landmark.collate("C")).limit(query.limit)
    return statement


def _column_conditions(columns: Columns, query: LandmarkQuery) -> Iterator[ColumnElement[bool]]:
    """What a query asks of the columns, area and version left out."""
    if query.kinds:
        yield columns.kind.in_(query.kinds)
    if query.max_sigma_m is not None:
        yield columns.sigma_major_m <= query.max_sigma_m
    if query.vehicle is not None:
        yield func.strpos(columns.vehicles, vehicle_item(query.vehicle)) > 0
    if query.seen is not None:
        yield columns.first_seen_ns <= query.seen.last_ns
        yield columns.last_seen_ns >= query.seen.first_ns
    if query.after is not None and not query.by_distance:
        yield columns.landmark.collate("C") > query.after.landmark


def _versions(columns: Columns, validity: Validity) -> Iterator[ColumnElement[bool]]:
    """What a validity asks of the columns."""
    ends = columns.valid_to_version
    if validity.valid_at is not None:
        yield columns.valid_from_version <= validity.valid_at
        yield or_(ends.is_(None), ends > validity.valid_at)
    if validity.opened_after is not None:
        yield columns.valid_from_version > validity.opened_after
    if validity.ended_by is not None:
        yield ends <= validity.ended_by


def found_landmark(row: Row[tuple[object, ...]]) -> Landmark:
    """The landmark of a row: easting, the fields in order, northing."""
    return landmark_of(row, easting_m=row[0], northing_m=row[-1])  # type: ignore[arg-type]


def _within(lon_deg: ColumnElement[float], lat_deg: ColumnElement[float], disc: Disc) -> ColumnElement[bool]:
    """Whether a position is within the disc: as the expression of the index on geography has it."""
    place = _geography(lon_deg, lat_deg)
    within: ColumnElement[bool] = func.ST_DWithin(
        place, _geography(disc.lon_deg, disc.lat_deg), disc.radius_m + RADIUS_MARGIN_M
    )
    return within


def _geography(lon_deg: ColumnElement[float] | float, lat_deg: ColumnElement[float] | float) -> ColumnElement[object]:
    place: ColumnElement[object] = func.geography(
        func.ST_SetSRID(func.ST_MakePoint(lon_deg, lat_deg), literal_column(str(WGS84_SRID)), type_=NullType),
        type_=NullType,
    )
    return place


def _window(box: DegreeBox, version: MapVersion) -> ColumnElement[object]:
    window = grid_window(box, version.crs)
    envelope: ColumnElement[object] = func.ST_MakeEnvelope(
        window["window_min_x"],
        window["window_min_y"],
        window["window_max_x"],
        window["window_max_y"],
        server_reference_of(version.crs).srs_id,
        type_=Geometry,
    )
    return envelope


def _is_near_origin(box: DegreeBox, version: MapVersion) -> bool:
    """Whether a box is small, and lies where the map's grid is sure to reach."""
    lon_deg, lat_deg = _origin_deg(version.crs, version.origin_easting_m, version.origin_northing_m)
    inside = abs(box.lon_min_deg - lon_deg) < REACH_DEG and abs(box.lon_max_deg - lon_deg) < REACH_DEG
    inside &= abs(box.lat_min_deg - lat_deg) < REACH_DEG and abs(box.lat_max_deg - lat_deg) < REACH_DEG
    return inside and box.lon_max_deg - box.lon_min_deg < WIDEST_INDEXED_DEG


@lru_cache(maxsize=16)
def _origin_deg(crs: str, easting_m: float, northing_m: float) -> tuple[float, float]:
    """Longitude and latitude of a map's origin."""
    lon_deg, lat_deg = transform_coordinates(
        np.array([easting_m]), np.array([northing_m]), source_crs=crs, target_crs=WGS84
    )
    return float(lon_deg[0]), float(lat_deg[0])
