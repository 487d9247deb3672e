"""The landmark database's schema on a server: brought up to date by its steps, or refused."""

from importlib.resources import files

from alembic import command
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, text

from trigpoint.errors import InputError
from trigpoint.landmarks import tables
from trigpoint.landmarks.geopackage_schema import SpatialReference, spatial_reference_of

STEPS = "trigpoint_schemas.migrations"
PRIVATE_SRID = 910_000  # of a CRS without an EPSG code: clear of those, and PostGIS takes numbers up to 998 999
DEFERRED_INDEXES = {
    "landmarks_geom": "landmarks USING gist (geom)",
    "landmarks_place": "landmarks USING gist ((ST_SetSRID(ST_MakePoint(lon_deg, lat_deg), 4326)::geography))",
    "landmark_history_geom": "landmark_history USING gist (geom)",
}
GEOMETRY_TABLES = ("landmarks", "landmark_history", "trajectories", "anchors")


def upgrade(connection: Connection, shown: str) -> None:
    """The schema as this program knows it, in the connection's transaction. Raises InputError for a newer one."""
    _require_known(connection, shown)
    config = _config()
    config.attributes["connection"] = connection
    command.upgrade(config, "head")


def require_current(connection: Connection, shown: str) -> None:
    """Raises InputError for a schema of another version than this program's, and where there is none."""
    held = _require_known(connection, shown)
    if held is None:
        raise InputError(f"no landmark database at {shown}")
    newest = _script().get_current_head()
    if held != newest:
        raise InputError(
            f"{shown}: schema {held} is older than {newest}: a service that writes it brings it up to date"
        )


def _require_known(connection: Connection, shown: str) -> str | None:
    held = MigrationContext.configure(connection).get_current_revision()
    known = [step.revision for step in _script().walk_revisions()]
    if held is not None and held not in known:
        raise InputError(f"{shown}: schema {held} is newer than {known[0]}, the newest this program knows")
    return held


def _config() -> Config:
    config = Config()
    config.set_main_option("script_location", str(files(STEPS)).replace("%", "%%"))
    return config


def _script() -> ScriptDirectory:
    return ScriptDirectory.from_config(_config())


def server_reference_of(crs: str) -> SpatialReference:
    """How a map's CRS is named on a server: by its EPSG code, else by a number left to users."""
    named = spatial_reference_of(crs)
    if named.organization == "EPSG":
        return named
    return SpatialReference(named.name, PRIVATE_SRID, "trigpoint", PRIVATE_SRID, named.definition)


def adopt_crs(connection: Connection, crs: str) -> None:
    """The geometry columns, all empty yet, are in the map's CRS from now on."""
    reference = server_reference_of(crs)
    connection.execute(
        text(
            "INSERT INTO spatial_ref_sys (srid, auth_name, auth_srid, srtext) "
            "SELECT :srid, :auth, :srid, :wkt WHERE NOT EXISTS (SELECT 1 FROM spatial_ref_sys WHERE srid = :srid)"
        ),
        {"srid": reference.srs_id, "auth": reference.organization, "wkt": reference.definition},
    )
    for view in tables.CURRENT_VIEWS:
        connection.execute(text(f"DROP VIEW {view}"))
    for table in GEOMETRY_TABLES:
        connection.execute(text(f"SELECT UpdateGeometrySRID('{table}', 'geom', {reference.srs_id})"))
    for statement in tables.CURRENT_VIEWS.values():
        connection.execute(text(statement))
