"""Writes a GeoPackage (OGC 12-128r18, version 1.3) of plain tables to hand over: indexed, styled, with its metadata."""

import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from trigpoint.errors import InputError
from trigpoint.geodesy.projection import WGS84, crs_wkt2
from trigpoint.landmarks import geopackage_schema as schema
from trigpoint.landmarks.geopackage_file import SQL_FUNCTIONS, database_errors
from trigpoint.landmarks.geopackage_geometry import encoded_line, encoded_point

Points = tuple[tuple[float, float], ...]
Row = tuple[Points, Sequence[object]]  # one point: a point, more: a line, none: no geometry; then a value a column

KINDS_MOST = 24  # of a table that get a colour of their own
USER_VERSION = 10300  # 1.3, which GDAL 3.6 and QGIS 3.22 read without a warning
REFERENCES_TABLE = """CREATE TABLE gpkg_spatial_ref_sys (srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY,
organization TEXT NOT NULL, organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT,
definition_12_063 TEXT NOT NULL, epoch DOUBLE)"""  # with the columns of the extension for WKT 2 and epochs
METADATA_TABLES = (
    """CREATE TABLE gpkg_metadata (id INTEGER CONSTRAINT m_pk PRIMARY KEY ASC NOT NULL,
    md_scope TEXT NOT NULL DEFAULT 'dataset', md_standard_uri TEXT NOT NULL,
    mime_type TEXT NOT NULL DEFAULT 'text/xml', metadata TEXT NOT NULL DEFAULT '')""",
    """CREATE TABLE gpkg_metadata_reference (reference_scope TEXT NOT NULL, table_name TEXT, column_name TEXT,
    row_id_value INTEGER, timestamp DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
    md_file_id INTEGER NOT NULL, md_parent_id INTEGER,
    CONSTRAINT crmr_mfi_fk FOREIGN KEY (md_file_id) REFERENCES gpkg_metadata(id),
    CONSTRAINT crmr_mpi_fk FOREIGN KEY (md_parent_id) REFERENCES gpkg_metadata(id))""",
)
ANY_METADATA = "https://www.geopackage.org/guidance/extensions/metadata.html"  # a standard: as its mime type says
METADATA_DEFINITION = "http://www.geopackage.org/spec140/#extension_metadata"
CRS_DEFINITION = "http://www.geopackage.org/spec140/#extension_crs_wkt"
WGS84_SRS_ID = 4326
CRS_EXTENSION = "gpkg_crs_wkt_1_1"  # its columns hold WKT 2 and the coordinate epoch
STYLES_TABLE = """CREATE TABLE layer_styles (id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, f_table_catalog TEXT,
f_table_schema TEXT, f_table_name TEXT, f_geometry_column TEXT, styleName TEXT, styleQML TEXT, styleSLD TEXT,
useAsDefault BOOLEAN, description TEXT, owner TEXT, ui TEXT, update_time DATETIME)"""


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenTable:
    """A table: `columns` are names with SQL types; `geometry_name` is POINT or LINESTRING, "" for no geometry."""

    name: str
    title: str
    description: str
    geometry_name: str
    columns: tuple[tuple[str, str], ...]


class GeoPackageWriting:
    """A GeoPackage being written, all of it in one CRS; `changed` is its tables' date, as 2023-11-14T22:13:20.000Z.

    Methods raise ServiceError and DatabaseUnavailable for what SQLite cannot write.
    """

    def __init__(self, driver: sqlite3.Connection, path: Path, *, crs: str, epoch: float | None, changed: str) -> None:
        self._driver, self._path, self._changed = driver, path, changed
        self._reference = schema.spatial_reference_of(crs)
        with database_errors(path):
            self._create(crs, epoch)

    def write(self, table: WrittenTable, batches: Iterable[Iterable[Row]]) -> None:
        """A table with all its rows and, where they have places, their spatial index."""
        with database_errors(self._path):
            geometry = (f"geom {table.geometry_name}",) if table.geometry_name else ()
            columns = ("fid INTEGER PRIMARY KEY", *geometry, *(f'"{name}" {kind}' for name, kind in table.columns))
            self._driver.execute(f"CREATE TABLE {table.name} ({', '.join(columns)})")
            places = ", ".join("?" * (len(columns) - 1))
            insert = f"INSERT INTO {table.name} VALUES (NULL, {places})"
            for batch in batches:
                self._driver.executemany(insert, self._values(batch, with_place=bool(table.geometry_name)))
            self._register(table)

    def describe(self, metadata: str, *, mime_type: str, standard: str) -> None:
        """What the file as a whole is."""
        with database_errors(self._path):
            inserted = "INSERT INTO gpkg_metadata VALUES (1, 'dataset', ?, ?, ?)"
            self._driver.execute(inserted, (standard, mime_type, metadata))
            referred = "INSERT INTO gpkg_metadata_reference VALUES ('geopackage', NULL, NULL, NULL, ?, 1, NULL)"
            self._driver.execute(referred, (self._changed,))

    def style(self, table: str, name: str, qml: str) -> None:
        """How QGIS draws a table unless it is told otherwise."""
        with database_errors(self._path):
            self._driver.execute(
                "INSERT INTO layer_styles (f_table_catalog, f_table_schema, f_table_name, f_geometry_column, "
                "styleName, styleQML, styleSLD, useAsDefault, description, owner, update_time) "
                "VALUES ('', '', ?, 'geom', ?, ?, '', 1, ?, '', ?)",
                (table, name, qml, name, self._changed),
            )

    def _create(self, crs: str, epoch: float | None) -> None:
        self._driver.execute(f"PRAGMA application_id = {schema.APPLICATION_ID}")
        self._driver.execute(f"PRAGMA user_version = {USER_VERSION}")
        for statement in (REFERENCES_TABLE, *schema.SYSTEM_TABLES[1:], *METADATA_TABLES, STYLES_TABLE):
            self._driver.execute(statement)
        for one in {row.srs_id: row for row in (*schema.required_references(), self._reference)}.values():
            self._refer(one)
        described = "UPDATE gpkg_spatial_ref_sys SET definition_12_063 = ?, epoch = ? WHERE srs_id = ?"
        self._driver.execute(described, (crs_wkt2(crs), epoch, self._reference.srs_id))
        for table in ("gpkg_metadata", "gpkg_metadata_reference"):
            self._extend(table, None, "gpkg_metadata", METADATA_DEFINITION)
        for name in ("definition_12_063", "epoch"):
            self._extend("gpkg_spatial_ref_sys", name, CRS_EXTENSION, CRS_DEFINITION)
        self._list("layer_styles", "attributes", "Layer styles", "Styles of QGIS", 0)

    def _refer(self, one: schema.SpatialReference) -> None:
        wkt2 = crs_wkt2(WGS84) if one.srs_id == WGS84_SRS_ID else "undefined"
        self._driver.execute(
            "INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, NULL, ?, NULL)",
            (one.name, one.srs_id, one.organization, one.organization_code, one.definition, wkt2),
        )

    def _values(self, batch: Iterable[Row], *, with_place: bool) -> Iterator[tuple[object, ...]]:
        for points, values in batch:
            yield (self._place(points), *values) if with_place else tuple(values)

    def _place(self, points: Points) -> bytes | None:
        srs_id = self._reference.srs_id
        if not points:
            return None
        return encoded_point(*points[0], srs_id=srs_id) if len(points) == 1 else encoded_line(points, srs_id=srs_id)

    def _register(self, table: WrittenTable) -> None:
        if not table.geometry_name:
            self._list(table.name, "attributes", table.title, table.description, 0)
            return
        srs_id = self._reference.srs_id
        self._list(table.name, "features", table.title, table.description, srs_id)
        self._driver.execute(
            "INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, 0, 0)",
            (table.name, table.geometry_name, srs_id),
        )
        index, *triggers = schema.rtree_statements(table.name, user_version=USER_VERSION)
        self._driver.execute(index)
        filled = f"SELECT fid, ST_MinX(geom), ST_MaxX(geom), ST_MinY(geom), ST_MaxY(geom) FROM {table.name}"
        self._driver.execute(f"INSERT INTO {schema.rtree_name(table.name)} {filled} WHERE geom NOTNULL")
        for statement in triggers:
            self._driver.execute(statement)
        self._extend(table.name, "geom", "gpkg_rtree_index", schema.RTREE_DEFINITION, scope="write-only")
        bounds = "min(ST_MinX(geom)), min(ST_MinY(geom)), max(ST_MaxX(geom)), max(ST_MaxY(geom))"
        self._driver.execute(
            "UPDATE gpkg_contents SET (min_x, min_y, max_x, max_y) = "
            f"(SELECT {bounds} FROM {table.name} WHERE geom NOTNULL) WHERE table_name = ?",
            (table.name,),
        )

    def _list(self, table: str, kind: str, title: str, description: str, srs_id: int) -> None:
        self._driver.execute(
            "INSERT INTO gpkg_contents (table_name, data_type, identifier, description, last_change, srs_id) "
            "VALUES (?, ?, ?, ?, ?, ?)",
            (table, kind, title, description, self._changed, srs_id),
        )

    def _extend(self, table: str, column: str | None, name: str, definition: str, scope: str = "read-write") -> None:
        self._driver.execute(
            "INSERT INTO gpkg_extensions VALUES (?, ?, ?, ?, ?)", (table, column, name, definition, scope)
        )


@contextmanager
def written_geopackage(path: Path, *, crs: str, epoch: float | None, changed: str) -> Iterator[GeoPackageWriting]:
    """A new file, written in one transaction; whoever calls makes it durable. Raises as GeoPackageWriting does."""
    with database_errors(path):
        driver = sqlite3.connect(path, isolation_level=None)
    try:
        for name, function in SQL_FUNCTIONS.items():
            driver.create_function(name, 1, function, deterministic=True)
        driver.execute("PRAGMA journal_mode = OFF")  # a file that is not whole is thrown away
        driver.execute("PRAGMA synchronous = OFF")
        driver.execute("BEGIN")
        yield GeoPackageWriting(driver, path, crs=crs, epoch=epoch, changed=changed)
        with database_errors(path):
            driver.execute("COMMIT")
    finally:
        driver.close()


@dataclass(frozen=True, slots=True, kw_only=True)
class HandedOver:
    """What a GeoPackage to hand over holds: tables, the box around them in its CRS, their kinds, and its metadata."""

    tables: tuple[str, ...]
    extent: tuple[float, float, float, float] | None
    kinds: Mapping[str, tuple[str, ...]]
    metadata: str


def read_handed_over(path: Path) -> HandedOver:
    """The contents of a file that `written_geopackage` wrote. Raises InputError for any other file."""
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    with database_errors(path), closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as driver:
        names = {name for (name,) in driver.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if not {"gpkg_metadata", "layer_styles"} <= names:
            raise InputError(f"{path} is not a GeoPackage of `trigpoint export gpkg`, which has metadata and styles")
        held = driver.execute(
            "SELECT table_name, min_x, min_y, max_x, max_y FROM gpkg_contents WHERE table_name != ?", ("layer_styles",)
        ).fetchall()
        metadata = driver.execute("SELECT metadata FROM gpkg_metadata WHERE id = 1").fetchone()
        tables = tuple(name for name, *_ in held)
        kinds = {name: _kinds(driver, name) for name in tables if _has_kind(driver, name)}
    if metadata is None:
        raise InputError(f"{path}: no metadata in it, which `trigpoint export gpkg` writes")
    boxes = [box for _, *box in held if box[0] is not None]
    return HandedOver(
        tables=tables,
        extent=_around(boxes),
        kinds=kinds,
        metadata=metadata[0],
    )


def _has_kind(driver: sqlite3.Connection, table: str) -> bool:
    return any(row[1] == "kind" for row in driver.execute("SELECT cid, name FROM pragma_table_info(?)", (table,)))


def _kinds(driver: sqlite3.Connection, table: str) -> tuple[str, ...]:
    quoted = table.replace('"', '""')
    return tuple(
        kind for (kind,) in driver.execute(f'SELECT DISTINCT kind FROM "{quoted}" ORDER BY kind LIMIT {KINDS_MOST}')
    )


def _around(boxes: Sequence[Sequence[float]]) -> tuple[float, float, float, float] | None:
    if not boxes:
        return None
    west, south, east, north = zip(*boxes, strict=True)
    return min(west), min(south), max(east), max(north)
