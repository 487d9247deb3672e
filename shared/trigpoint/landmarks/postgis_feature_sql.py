"""Pages of features as SQL statements of PostGIS; every value is bound."""

from functools import lru_cache

from trigpoint.landmarks.conditions import box_of
from trigpoint.landmarks.feature_areas import indexed_window
from trigpoint.landmarks.feature_crs import DEGREE_DECIMALS, METRE_DECIMALS, WEB_MERCATOR, FeatureCrs
from trigpoint.landmarks.feature_query import FeatureQuery, GridBox, MapState
from trigpoint.landmarks.layer_sql import AS_OF, FEATURE_ID, HAS_DEGREES, SOURCES, RowSource, columns_of
from trigpoint.landmarks.layers import Layer
from trigpoint.landmarks.postgis_conditions import BoundValues, condition_sql
from trigpoint.landmarks.postgis_schema import server_reference_of
from trigpoint.landmarks.queries import DegreeBox

PLACE_DEG = "ST_SetSRID(ST_MakePoint(lon_deg, lat_deg), 4326)"
LINE_DEG = "ST_Transform(geom, 4326)"
NEWEST = "(SELECT max(map_version) FROM map_versions)"
EARTH_RADIUS_M = 6_378_137.0  # of Web Mercator's sphere
MERCATOR_X = f"{EARTH_RADIUS_M} * radians(lon_deg)"
MERCATOR_Y = f"{EARTH_RADIUS_M} * asinh(tan(radians(lat_deg)))"


def _rounded(expression: str, decimals: int) -> str:
    return f"round(({expression}) * 1e{decimals}) / 1e{decimals}"


# The texts of a landmark's properties; of the columns that hold JSON the text is the value.
PROPERTY_TEXTS = {
    **{name: f"to_json({name})" for name in ("landmark", "kind", "signature")},
    **{name: _rounded(name, METRE_DECIMALS) for name in ("x_m", "y_m")},
    "easting_m": _rounded("ST_X(geom)", METRE_DECIMALS),
    "northing_m": _rounded("ST_Y(geom)", METRE_DECIMALS),
    "covariance_m2": "'[[' || variance_x_m2 || ',' || covariance_xy_m2 || '],['"
    " || covariance_xy_m2 || ',' || variance_y_m2 || ']]'",
    **{name: _rounded(name, METRE_DECIMALS) for name in ("sigma_major_m", "sigma_minor_m")},
    "ellipse_heading_rad": "ellipse_heading_rad",
    "observation_count": "observation_count",
    "vehicles": "vehicles",
    "first_seen_ns": "first_seen_ns",
    "last_seen_ns": "last_seen_ns",
    "anchored": "anchored",
    "anchors": "anchors",
    "valid_from_version": "valid_from_version",
    "valid_to_version": "coalesce(valid_to_version::text, 'null')",
}


@lru_cache(maxsize=16)
def landmark_text(crs: FeatureCrs) -> str:
    """A landmark's GeoJSON as an expression: joined texts cost half of what the server's own JSON functions do."""
    if crs.is_wgs84:
        x, y = "lon_deg", "lat_deg"
    elif crs.crs == WEB_MERCATOR:
        x, y = MERCATOR_X, MERCATOR_Y
    else:
        x, y = "ST_X(geom)", "ST_Y(geom)"
    first, second = (y, x) if crs.north_first else (x, y)
    decimals = DEGREE_DECIMALS if crs.in_degrees else METRE_DECIMALS
    properties = " || ',".join(f'"{name}":\' || {text}' for name, text in PROPERTY_TEXTS.items())
    return (
        f"""'{{"type":"Feature","id":' || to_json(landmark) || ',"geometry":{{"type":"Point","coordinates":['"""
        f""" || {_rounded(first, decimals)} || ',' || {_rounded(second, decimals)} || ']}},"properties":{{"""
        f"""{properties} || '}}}}'"""
    )


def landmark_page_statement(query: FeatureQuery, state: MapState) -> tuple[str, dict[str, object]]:
    """One row: the version, how many features (one more than the limit: there are more), their text, the last id."""
    values = BoundValues()
    sources = SOURCES["landmarks"] if query.as_of is not None else SOURCES["landmarks"][:1]
    columns = ", ".join(columns_of(sources[0].table))
    rows = " UNION ALL ".join(
        f"SELECT {columns} FROM {source.table.name}{_where(source, query, state, values)}" for source in sources
    )
    # The text beside the limit, not below it: it is made of what is on the page, not of all that is found.
    text = f"{landmark_text(query.crs)} AS feature"
    page = f"SELECT landmark, {text} FROM ({rows}) found ORDER BY landmark LIMIT {values.bound(query.limit + 1)}"
    shown = NEWEST if query.as_of is None else values.bound(query.as_of)
    return (
        f"SELECT {shown}, count(*), coalesce(string_agg(feature, ','), ''), max(landmark) FROM ({page}) page",
        values.by_name,
    )


def row_page_statement(query: FeatureQuery, state: MapState) -> tuple[str, dict[str, object]]:
    """The rows of a layer, each as its columns, one more than the limit if there are."""
    values = BoundValues()
    feature_id = FEATURE_ID[query.layer.name]
    rows = " UNION ALL ".join(
        f"SELECT {', '.join(columns_of(source.table))} FROM {source.table.name}{_where(source, query, state, values)}"
        for source in SOURCES[query.layer.name]
    )
    return (
        f"SELECT * FROM ({rows}) page ORDER BY ({feature_id}) LIMIT {values.bound(query.limit + 1)}",
        values.by_name,
    )


def _where(source: RowSource, query: FeatureQuery, state: MapState, values: BoundValues) -> str:
    """The conditions of a query on one table."""
    conditions = []
    if query.as_of is not None:
        conditions.append(source.at_version.replace(AS_OF, values.bound(query.as_of)))
    feature_id = FEATURE_ID[query.layer.name]
    if query.areas:
        conditions.append(_any_area(query, state, values))
    if query.during is not None and query.layer.times is not None:
        first, last = query.layer.times
        conditions.append(f"{first} <= {values.bound(query.during.last_ns)}")
        conditions.append(f"{last} >= {values.bound(query.during.first_ns)}")
    if query.condition is not None:
        conditions += _condition(query, state, values)
    if query.feature_id is not None:
        conditions.append(f"({feature_id}) = {values.bound(query.feature_id)}")
    if query.first_id is not None:
        conditions.append(f"({feature_id}) >= {values.bound(query.first_id)}")
    return f" WHERE {' AND '.join(conditions)}" if conditions else ""


def _condition(query: FeatureQuery, state: MapState, values: BoundValues) -> list[str]:
    """The filter, and the box around what it can be met by, which an index serves."""
    assert query.condition is not None
    columns = {one.name: one.name for one in query.layer.properties}
    columns |= {"easting_m": "ST_X(geom)", "northing_m": "ST_Y(geom)"}
    geometry = PLACE_DEG if query.layer.name in HAS_DEGREES else LINE_DEG
    box = box_of(query.condition)
    window = None if box is None else indexed_window(box, state)
    indexed = [] if window is None else [f"geom && {envelope_sql(window, state, values)}"]
    return [*indexed, condition_sql(query.condition, columns, geometry, values)]


def _any_area(query: FeatureQuery, state: MapState, values: BoundValues) -> str:
    if not query.layer.geometry:
        return "FALSE"
    areas = [area_sql(area, query.layer, state, values) for area in query.areas]
    return areas[0] if len(areas) == 1 else f"({' OR '.join(areas)})"


def area_sql(area: DegreeBox | GridBox, layer: Layer, state: MapState, values: BoundValues) -> str:
    """The condition that a feature of a layer meets an area, what an index can tell of it first."""
    if isinstance(area, GridBox):
        envelope = envelope_sql(area, state, values)
        return f"(geom && {envelope} AND ST_Intersects(geom, {envelope}))"
    window = indexed_window(area, state)
    indexed = "" if window is None else f"geom && {envelope_sql(window, state, values)} AND "
    west, south = values.bound(area.lon_min_deg), values.bound(area.lat_min_deg)
    east, north = values.bound(area.lon_max_deg), values.bound(area.lat_max_deg)
    if layer.name in HAS_DEGREES:
        return f"({indexed}lon_deg BETWEEN {west} AND {east} AND lat_deg BETWEEN {south} AND {north})"
    return f"({indexed}ST_Intersects({LINE_DEG}, ST_MakeEnvelope({west}, {south}, {east}, {north}, 4326)))"


def envelope_sql(box: GridBox, state: MapState, values: BoundValues) -> str:
    """The box as a geometry in the map's CRS."""
    corners = (box.easting_min_m, box.northing_min_m, box.easting_max_m, box.northing_max_m)
    bound = ", ".join(values.bound(corner) for corner in corners)
    return f"ST_MakeEnvelope({bound}, {srid_of(state.crs)})"


@lru_cache(maxsize=16)
def srid_of(crs: str) -> int:
    """The number of a map's CRS on a server."""
    return server_reference_of(crs).srs_id
