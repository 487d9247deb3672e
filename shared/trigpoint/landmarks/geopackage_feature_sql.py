"""Pages of features and tiles as SQL statements on a GeoPackage: what its index and columns can tell."""

from dataclasses import dataclass, field

from trigpoint.geodesy.web_tiles import WebTile
from trigpoint.landmarks.conditions import box_of
from trigpoint.landmarks.feature_areas import indexed_window
from trigpoint.landmarks.feature_query import FeatureQuery, GridBox, MapState
from trigpoint.landmarks.geopackage_schema import rtree_name
from trigpoint.landmarks.layer_sql import AS_OF, FEATURE_ID, HAS_DEGREES, SOURCES, RowSource, columns_of
from trigpoint.landmarks.layers import Layer
from trigpoint.landmarks.queries import DegreeBox
from trigpoint.landmarks.tile_grid import TILE_PROPERTIES, buffered_box

Bound = dict[str, object]


@dataclass(slots=True)
class _Values:
    """The values of a statement, each under a name."""

    by_name: Bound = field(default_factory=dict)

    def bound(self, value: object) -> str:
        name = f"v{len(self.by_name)}"
        self.by_name[name] = value
        return f":{name}"


def page_statement(query: FeatureQuery, state: MapState, *, as_of: int) -> tuple[str, Bound]:
    """The rows that may meet a query, in order of id: all that do, and some that do not."""
    values = _Values()
    feature_id = FEATURE_ID[query.layer.name]
    rows = " UNION ALL ".join(
        f"SELECT {', '.join(columns_of(source.table))} FROM {source.table.name} "
        f"WHERE {_at(source, as_of, values)}{_where(source, query, state, values)}"
        for source in SOURCES[query.layer.name]
    )
    return f"{rows} ORDER BY {feature_id}", values.by_name  # in two tables: each by its index, merged as they are read


def tile_statement(layer: Layer, tile: WebTile, state: MapState, *, as_of: int) -> tuple[str, Bound]:
    """The rows a tile may show: a point's properties, longitude, latitude; of a line the geometry, then properties."""
    values, area = _Values(), buffered_box(tile)
    names = ", ".join(name for name in TILE_PROPERTIES[layer.name] if name != "left_out")
    columns = f"{names}, lon_deg, lat_deg" if layer.name in HAS_DEGREES else f"geom, {names}"
    rows = " UNION ALL ".join(
        f"SELECT {columns} FROM {source.table.name} "
        f"WHERE geom NOTNULL AND {_at(source, as_of, values)} AND {_area(area, source, state, values)}"
        for source in SOURCES[layer.name]
    )
    return rows, values.by_name


def _at(source: RowSource, as_of: int, values: _Values) -> str:
    return source.at_version.replace(AS_OF, values.bound(as_of))


def _where(source: RowSource, query: FeatureQuery, state: MapState, values: _Values) -> str:
    """The conditions of a query that the database looks at, each after AND."""
    feature_id = FEATURE_ID[query.layer.name]
    conditions = []
    if query.areas:
        areas = [_area(area, source, state, values) for area in query.areas] if query.layer.geometry else ["0"]
        conditions.append(f"({' OR '.join(areas)})")
    box = box_of(query.condition)
    if box is not None:
        conditions.append(_area(box, source, state, values))
    if query.during is not None and query.layer.times is not None:
        first, last = query.layer.times
        conditions.append(f"{first} <= {values.bound(query.during.last_ns)}")
        conditions.append(f"{last} >= {values.bound(query.during.first_ns)}")
    if query.feature_id is not None:
        conditions.append(f"({feature_id}) = {values.bound(query.feature_id)}")
    if query.first_id is not None:
        conditions.append(f"({feature_id}) >= {values.bound(query.first_id)}")
    return "".join(f" AND {condition}" for condition in conditions)


def _area(area: DegreeBox | GridBox, source: RowSource, state: MapState, values: _Values) -> str:
    """What holds for every feature that meets an area."""
    conditions = []
    window = area if isinstance(area, GridBox) else indexed_window(area, state)
    if window is not None:
        inside = " AND ".join(
            (
                f"maxx >= {values.bound(window.easting_min_m)}",
                f"minx <= {values.bound(window.easting_max_m)}",
                f"maxy >= {values.bound(window.northing_min_m)}",
                f"miny <= {values.bound(window.northing_max_m)}",
            )
        )
        conditions.append(f"fid IN (SELECT id FROM {rtree_name(source.table.name)} WHERE {inside})")
    if isinstance(area, DegreeBox) and "lon_deg" in source.table.columns:
        conditions.append(f"lon_deg BETWEEN {values.bound(area.lon_min_deg)} AND {values.bound(area.lon_max_deg)}")
        conditions.append(f"lat_deg BETWEEN {values.bound(area.lat_min_deg)} AND {values.bound(area.lat_max_deg)}")
    return f"({' AND '.join(conditions)})" if conditions else "1"
