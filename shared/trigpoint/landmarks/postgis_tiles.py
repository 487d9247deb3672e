"""Vector tiles as SQL statements of PostGIS: made whole by the server, every value bound."""

from trigpoint.geodesy.web_tiles import WebTile
from trigpoint.landmarks.feature_areas import indexed_window
from trigpoint.landmarks.feature_query import MapState
from trigpoint.landmarks.layer_sql import AS_OF, SOURCES, RowSource
from trigpoint.landmarks.layers import Layer
from trigpoint.landmarks.postgis_conditions import BoundValues
from trigpoint.landmarks.postgis_feature_sql import area_sql, envelope_sql
from trigpoint.landmarks.tile_grid import (
    BUFFER,
    CELL,
    EXTENT,
    PRECEDENCE,
    TILE_PROPERTIES,
    TileFrame,
    buffered_box,
    is_crowded,
    tile_frame,
)

CELLS = f"div(tx + {BUFFER}, {CELL}), div(ty + {BUFFER}, {CELL})"
LEFT_OUT = "left_out"


def tile_statement(layer: Layer, tile: WebTile, state: MapState, *, as_of: int) -> tuple[str, dict[str, object]]:
    """One row with one value: the tile of a layer in a map version, NULL or empty if nothing is in it."""
    values = BoundValues()
    features = _points if layer.geometry == "Point" else _lines
    shown = features(layer, tile, state, values.bound(as_of), values)
    statement = f"SELECT ST_AsMVT(shown, '{layer.name}', {EXTENT}, 'geom') FROM ({shown}) shown WHERE geom IS NOT NULL"
    return statement, values.by_name


def _points(layer: Layer, tile: WebTile, state: MapState, version: str, values: BoundValues) -> str:
    """The points of a tile, each of a crowd's cells as one."""
    columns = ", ".join(name for name in TILE_PROPERTIES[layer.name] if name != LEFT_OUT)
    box = buffered_box(tile)
    window = indexed_window(box, state)
    # The window is wide enough for its index to miss none; which of them the tile shows is told by their units.
    area = area_sql(box, layer, state, values) if window is None else f"geom && {envelope_sql(window, state, values)}"
    found = " UNION ALL ".join(
        f"SELECT {columns}, lon_deg, lat_deg FROM {source.table.name} WHERE {_at(source, version)} AND {area}"
        for source in SOURCES[layer.name]
    )
    # OFFSET 0 keeps the planner from working out every unit anew wherever it is used.
    placed = f"SELECT {columns}, {_unit_sql(tile_frame(tile), values)} FROM ({found}) found OFFSET 0"
    within = " AND ".join(f"{axis} BETWEEN {-BUFFER} AND {EXTENT + BUFFER - 1}" for axis in ("tx", "ty"))
    inside = f"SELECT * FROM ({placed}) placed WHERE {within}"
    shown = f"SELECT ST_MakePoint(tx, ty) AS geom, {columns}"
    if not is_crowded(layer, tile):
        return f"{shown}, 0 AS {LEFT_OUT} FROM ({inside}) inside"
    order = ", ".join(f'{name} COLLATE "C"' if _is_text(layer, name) else name for name in PRECEDENCE[layer.name])
    first = f"SELECT DISTINCT ON ({CELLS}) *, count(*) OVER (PARTITION BY {CELLS}) - 1 AS {LEFT_OUT}"
    return f"{shown}, {LEFT_OUT} FROM ({first} FROM ({inside}) inside ORDER BY {CELLS}, {order}) first"


def _unit_sql(frame: TileFrame, values: BoundValues) -> str:
    """Where a position is in the tile's units, tx to the east and ty to the south."""
    world = f"CAST({values.bound(frame.world)} AS double precision)"
    east = f"CAST(round((lon_deg + 180) / 360 * {world}) AS bigint)"
    south = f"CAST(round((1 - asinh(tan(radians(lat_deg))) / pi()) / 2 * {world}) AS bigint)"
    return f"{east} - {values.bound(frame.left)} AS tx, {south} - {values.bound(frame.top)} AS ty"


def _lines(layer: Layer, tile: WebTile, state: MapState, version: str, values: BoundValues) -> str:
    """The lines of a tile, cut at its buffer."""
    (source,) = SOURCES[layer.name]
    window = indexed_window(buffered_box(tile), state)
    near = "" if window is None else f" AND geom && {envelope_sql(window, state, values)}"
    bounds = f"ST_TileEnvelope({tile.zoom}, {tile.column}, {tile.row})"
    drawn = f"ST_AsMVTGeom(ST_Transform(geom, 3857), {bounds}, {EXTENT}, {BUFFER}, true) AS geom"
    columns = ", ".join(TILE_PROPERTIES[layer.name])
    return f"SELECT {drawn}, {columns} FROM {source.table.name} WHERE {_at(source, version)}{near}"


def _at(source: RowSource, version: str) -> str:
    return source.at_version.replace(AS_OF, version)


def _is_text(layer: Layer, name: str) -> bool:
    found = layer.property_named(name)
    return found is not None and found.kind == "string"
