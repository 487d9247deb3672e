"""Opens and creates a landmark GeoPackage: plain sqlite3, no extension to load."""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from json import JSONDecodeError
from pathlib import Path

from sqlalchemy import Connection, create_engine, text
from sqlalchemy.exc import DatabaseError
from sqlalchemy.pool import StaticPool

from trigpoint.errors import DatabaseUnavailable, InputError, ServiceError
from trigpoint.landmarks import geopackage_geometry as geometry
from trigpoint.landmarks import geopackage_schema as schema
from trigpoint.landmarks import tables

CACHE_KIB = 65_536  # holds a map of 200 000 landmarks; SQLite's own 2 MB make every query read the file
BUSY_TIMEOUT_S = 30.0  # how long a GIS program that is reading may keep a map version waiting
DAMAGE_CODES = frozenset({sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_CORRUPT_VTAB})
PASSING_CODES = frozenset({sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED, sqlite3.SQLITE_FULL})
UNDATED = "1970-01-01T00:00:00.000Z"  # of layers still empty: a file's content never depends on the clock
SQL_FUNCTIONS = {
    "ST_MinX": geometry.min_x,
    "ST_MaxX": geometry.max_x,
    "ST_MinY": geometry.min_y,
    "ST_MaxY": geometry.max_y,
    "ST_IsEmpty": geometry.is_empty,
}


@contextmanager
def database_errors(path: Path) -> Iterator[None]:
    """SQLite's errors inside, with the file's name: InputError if the file is damaged or none, DatabaseUnavailable if
    it is locked or the disk full, else ServiceError."""
    try:
        yield
    except (UnicodeDecodeError, JSONDecodeError) as error:
        raise InputError(f"{path} is not a sound database: {error}; delete it and replay the log") from error
    except (DatabaseError, sqlite3.DatabaseError) as error:
        cause = error.orig if isinstance(error, DatabaseError) else error
        if _is_damage(cause):
            raise InputError(f"{path} is not a sound database: {cause}; delete it and replay the log") from error
        kind = DatabaseUnavailable if _primary_code(cause) in PASSING_CODES else ServiceError
        raise kind(f"landmark database {path}: {cause}") from error


def _primary_code(cause: BaseException | None) -> int:
    """SQLite's error code without its details."""
    return getattr(cause, "sqlite_errorcode", 0) & 0xFF


def _is_damage(cause: BaseException | None) -> bool:
    code = getattr(cause, "sqlite_errorcode", None)
    undecodable = isinstance(cause, sqlite3.OperationalError) and code is None  # sqlite3's own: text that is not UTF-8
    return undecodable or code in DAMAGE_CODES


@contextmanager
def transaction(connection: Connection) -> Iterator[None]:
    """All statements inside, or none; other writers wait."""
    connection.execute(text("BEGIN IMMEDIATE"))
    try:
        yield
        connection.execute(text("COMMIT"))  # fails where a reader does not let go in time
    except BaseException:
        if driver_of(connection).in_transaction:  # a full disk makes SQLite roll back by itself
            connection.execute(text("ROLLBACK"))
        raise


@contextmanager
def one_state(driver: sqlite3.Connection) -> Iterator[None]:
    """All questions inside are answered from one state of the file, whatever another process writes."""
    driver.execute("BEGIN")
    try:
        yield
    finally:
        driver.execute("COMMIT")


@contextmanager
def indexed_at_once(driver: sqlite3.Connection, table: str) -> Iterator[None]:
    """Rows inserted inside enter their layer's spatial index together at the end: four times faster than by trigger.

    Only inside a transaction, which takes the trigger's absence back should anything fail.
    """
    index = schema.rtree_name(table)
    (trigger,) = driver.execute("SELECT sql FROM sqlite_master WHERE name = ?", (f"{index}_insert",)).fetchone()
    (last_fid,) = driver.execute(f"SELECT coalesce(max(fid), 0) FROM {table}").fetchone()
    driver.execute(f"DROP TRIGGER {index}_insert")
    yield
    bounds = "ST_MinX(geom), ST_MaxX(geom), ST_MinY(geom), ST_MaxY(geom)"
    driver.execute(f"INSERT INTO {index} SELECT fid, {bounds} FROM {table} WHERE fid > ?", (last_fid,))
    driver.execute(trigger)


def driver_of(connection: Connection) -> sqlite3.Connection:
    """The sqlite3 connection inside."""
    driver = connection.connection.driver_connection
    assert isinstance(driver, sqlite3.Connection)
    return driver


def opened(path: Path, *, read_only: bool) -> Connection:
    """A connection to the landmark database in a file, which is created unless `read_only`.

    Raises InputError for a file that is no sound landmark database of this version, and for one that is missing
    while `read_only`; ServiceError if it cannot be opened or created.
    """
    if read_only and not path.is_file():
        raise InputError(f"no landmark database at {path}")
    with database_errors(path):
        connection = _connected(path, read_only=read_only)
        try:
            _prepared(connection, path, read_only=read_only)
        except BaseException:
            close(connection)
            raise
    return connection


def close(connection: Connection) -> None:
    """The connection and its file handle closed."""
    connection.close()
    connection.engine.dispose()


def _connected(path: Path, *, read_only: bool) -> Connection:
    def driver() -> sqlite3.Connection:
        mode = "rw" if read_only else "rwc"  # even a reader takes back what a killed writer left half done
        return sqlite3.connect(f"{path.absolute().as_uri()}?mode={mode}", uri=True, timeout=BUSY_TIMEOUT_S)

    engine = create_engine("sqlite://", creator=driver, poolclass=StaticPool, isolation_level="AUTOCOMMIT")
    connection = engine.connect()
    driver_of(connection).execute(f"PRAGMA cache_size = -{CACHE_KIB}")
    driver_of(connection).execute(f"PRAGMA query_only = {int(read_only)}")
    for name, function in SQL_FUNCTIONS.items():
        driver_of(connection).create_function(name, 1, function, deterministic=True)
    return connection


def _prepared(connection: Connection, path: Path, *, read_only: bool) -> None:
    application_id = connection.scalar(text("PRAGMA application_id"))
    empty = connection.scalar(text("SELECT count(*) FROM sqlite_master")) == 0
    if empty and not read_only:
        with transaction(connection):
            _created(connection)
    elif application_id != schema.APPLICATION_ID:
        raise InputError(
            f"{path} is not a GeoPackage: application id {application_id:#x} instead of {schema.APPLICATION_ID:#x}"
        )
    _require_tables(connection, path)


def _require_tables(connection: Connection, path: Path) -> None:
    for table in tables.metadata.sorted_tables:
        held = {row[1] for row in connection.execute(text(f"PRAGMA table_info({table.name})"))}
        wanted = set(table.columns.keys())
        if held != wanted:
            raise InputError(
                f"{path}: table {table.name} has columns {sorted(held)} instead of {sorted(wanted)}; "
                "another version of the program wrote it: delete it and replay the log"
            )


def _created(connection: Connection) -> None:
    connection.execute(text(f"PRAGMA application_id = {schema.APPLICATION_ID}"))
    connection.execute(text(f"PRAGMA user_version = {schema.USER_VERSION}"))
    for statement in schema.SYSTEM_TABLES:
        driver_of(connection).execute(statement)
    for reference in schema.required_references():
        insert_reference(connection, reference)
    tables.copied_metadata().create_all(connection)
    for view in tables.CURRENT_VIEWS.values():
        connection.execute(text(view))
    for feature_layer in schema.FEATURE_LAYERS:
        _register_features(connection, feature_layer)
    for attribute_layer in schema.ATTRIBUTE_LAYERS:
        _register_content(connection, attribute_layer, data_type="attributes", srs_id=0)


def insert_reference(connection: Connection, reference: schema.SpatialReference) -> None:
    """A spatial reference in the file, once."""
    driver_of(connection).execute(
        "INSERT OR IGNORE INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, NULL)",
        (
            reference.name,
            reference.srs_id,
            reference.organization,
            reference.organization_code,
            reference.definition,
        ),
    )


def _register_content(
    connection: Connection, layer: schema.FeatureLayer | schema.AttributeLayer, *, data_type: str, srs_id: int
) -> None:
    driver_of(connection).execute(
        "INSERT INTO gpkg_contents (table_name, data_type, identifier, description, last_change, srs_id) "
        "VALUES (?, ?, ?, ?, ?, ?)",
        (layer.name, data_type, layer.name, layer.description, UNDATED, srs_id),
    )


def _register_features(connection: Connection, layer: schema.FeatureLayer) -> None:
    _register_content(connection, layer, data_type="features", srs_id=schema.UNDEFINED_CARTESIAN)
    driver = driver_of(connection)
    driver.execute(
        "INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, 0, 0)",
        (layer.name, layer.geometry_name, schema.UNDEFINED_CARTESIAN),
    )
    if layer.indexed:
        for statement in schema.rtree_statements(layer.name):
            driver.execute(statement)
        driver.execute(
            "INSERT INTO gpkg_extensions VALUES (?, 'geom', 'gpkg_rtree_index', ?, 'write-only')",
            (layer.name, schema.RTREE_DEFINITION),
        )
