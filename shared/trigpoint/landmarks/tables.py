"""The landmark map's tables: one model for every database, with geometry as the one type that differs."""

from typing import Any

from sqlalchemy import (
    REAL,
    BigInteger,
    Boolean,
    Column,
    Double,
    Integer,
    MetaData,
    Select,
    Table,
    Text,
    UniqueConstraint,
    func,
    select,
)
from sqlalchemy.engine import Dialect
from sqlalchemy.types import LargeBinary, TypeDecorator, TypeEngine, UserDefinedType

from trigpoint.landmarks import postgis_geometry
from trigpoint.landmarks.geopackage_geometry import Coordinates, decoded, encoded_line, encoded_point

metadata = MetaData()

# A GeoPackage has TEXT, INTEGER and REAL: GDAL skips VARCHAR columns there and reads FLOAT as 32 bits. All numbers
# have 64 bits in every database, REAL in a GeoPackage among them; PostgreSQL's REAL would have 32.
WholeNumber = BigInteger().with_variant(Integer, "sqlite")
RealNumber: TypeEngine[float] = Double().with_variant(REAL, "sqlite")
UNKNOWN_SRID = -1  # any, until the map's CRS is known


class GeometryColumn(UserDefinedType[bytes]):
    """A column whose SQL type is the geometry's name, as GeoPackage wants it."""

    cache_ok = True

    def __init__(self, geometry_name: str) -> None:
        self.geometry_name = geometry_name

    def get_col_spec(self, **_: Any) -> str:
        """The column's SQL type."""
        return self.geometry_name


class LandmarkGeometry(TypeDecorator[tuple[int, Coordinates]]):
    """A point ("POINT") or line ("LINESTRING") as (srs id, coordinates): GeoPackage bytes on SQLite, a PostGIS geometry
    on PostgreSQL."""

    impl = LargeBinary
    cache_ok = True

    def __init__(self, geometry_name: str) -> None:
        super().__init__()
        self.geometry_name = geometry_name

    def load_dialect_impl(self, dialect: Dialect) -> TypeEngine[Any]:
        """The column type of a database."""
        if dialect.name == "postgresql":
            from geoalchemy2 import Geometry  # costs half a second, which a GeoPackage does not need

            return Geometry(self.geometry_name, srid=UNKNOWN_SRID, spatial_index=False)
        return dialect.type_descriptor(GeometryColumn(self.geometry_name))

    def process_bind_param(self, value: tuple[int, Coordinates] | None, dialect: Dialect) -> bytes | str | None:
        """GeoPackage bytes, or what PostGIS reads as a geometry."""
        if value is None:
            return None
        srs_id, points = value
        if dialect.name == "postgresql":
            return postgis_geometry.encoded(points, srs_id=srs_id).hex()
        if self.geometry_name == "POINT":
            return encoded_point(*points[0], srs_id=srs_id)
        return encoded_line(points, srs_id=srs_id)

    def process_result_value(self, value: Any, dialect: Dialect) -> tuple[int, Coordinates] | None:
        """The srs id and the coordinates."""
        if value is None:
            return None
        if dialect.name == "postgresql":
            return postgis_geometry.decoded(bytes.fromhex(value.desc))
        return int.from_bytes(value[4:8], "little", signed=True), decoded(value)


def _whole(name: str, *, nullable: bool = False) -> Column[int]:
    return Column(name, WholeNumber, nullable=nullable)


def _real(name: str, *, nullable: bool = False) -> Column[float]:
    return Column(name, RealNumber, nullable=nullable)


def _text(name: str) -> Column[str]:
    return Column(name, Text, nullable=False)


def _feature_id() -> Column[int]:
    return Column("fid", WholeNumber, primary_key=True)


def _covariance() -> tuple[Column[float], ...]:
    return _real("variance_x_m2"), _real("covariance_xy_m2"), _real("variance_y_m2")


def _landmark_table(name: str, *constraints: UniqueConstraint) -> Table:
    return Table(
        name,
        metadata,
        _feature_id(),
        Column("geom", LandmarkGeometry("POINT"), nullable=False),
        *(_text(column) for column in ("landmark", "kind", "signature")),
        *(_real(column) for column in ("x_m", "y_m", "lat_deg", "lon_deg")),
        *_covariance(),
        *(_real(column) for column in ("sigma_major_m", "sigma_minor_m", "ellipse_heading_rad")),
        _whole("observation_count"),
        _text("vehicles"),
        _whole("first_seen_ns"),
        _whole("last_seen_ns"),
        Column("anchored", Boolean, nullable=False),
        _text("anchors"),
        _text("provenance"),
        _whole("valid_from_version"),
        _whole("valid_to_version", nullable=True),
        *constraints,
    )


# What is valid now stands apart from what was: GIS programs then show the map of today, and its index stays small.
landmarks = _landmark_table("landmarks", UniqueConstraint("landmark"))
landmark_history = _landmark_table("landmark_history", UniqueConstraint("landmark", "valid_from_version"))

trajectories = Table(
    "trajectories",
    metadata,
    _feature_id(),
    Column("geom", LandmarkGeometry("LINESTRING"), nullable=True),
    _whole("map_version"),
    _text("vehicle"),
    _text("boot_id"),
    _whole("first_stamp_ns"),
    _whole("last_stamp_ns"),
    _whole("pose_count"),
    _real("length_m"),
    _text("calibration_json"),
    UniqueConstraint("vehicle", "boot_id", "map_version"),
)

anchors = Table(
    "anchors",
    metadata,
    _feature_id(),
    Column("geom", LandmarkGeometry("POINT"), nullable=True),
    _whole("map_version"),
    *(_text(column) for column in ("anchor", "image", "kind", "signature", "landmark", "reason")),
    *(_real(column, nullable=True) for column in ("sigma_m", "residual_x_m", "residual_y_m", "residual_m")),
    *(_real(column, nullable=True) for column in ("lat_deg", "lon_deg")),
    UniqueConstraint("anchor", "image", "map_version"),
)

image_offsets = Table(
    "image_offsets",
    metadata,
    _feature_id(),
    _whole("map_version"),
    _text("image"),
    _real("offset_x_m"),
    _real("offset_y_m"),
    *_covariance(),
    UniqueConstraint("image", "map_version"),
)

label_gains = Table(
    "label_gains",
    metadata,
    _feature_id(),
    _whole("map_version"),
    *(_text(column) for column in ("image", "landmarks_json", "terms_json")),
    UniqueConstraint("map_version", "image"),
)

map_versions = Table(
    "map_versions",
    metadata,
    Column("map_version", WholeNumber, primary_key=True, autoincrement=False),
    _whole("base_version"),
    *(_text(column) for column in ("method", "settings_json", "inputs_json")),
    _whole("landmark_count"),
    _whole("anchor_count"),
    _real("wall_s"),
    _whole("solved_ns"),
    _text("log_stream"),
    _whole("log_number"),
    _text("crs"),
    _real("origin_easting_m"),
    _real("origin_northing_m"),
    _text("operation"),
    _real("operation_accuracy_m"),
)

checkpoints = Table(
    "log_checkpoints",
    metadata,
    _feature_id(),
    _text("stream"),
    _whole("next_number"),
    UniqueConstraint("stream"),
)


def _current(table: str, *key: str) -> str:
    """The view of a table's newest rows: one of each key, none from before the newest version that is whole."""
    same = " AND ".join(f"later.{column} = {table}.{column}" for column in key)
    return (
        f"CREATE VIEW current_{table} AS SELECT * FROM {table} "
        "WHERE map_version >= (SELECT max(map_version) FROM map_versions WHERE base_version = 0) "
        f"AND NOT EXISTS (SELECT 1 FROM {table} later WHERE {same} AND later.map_version > {table}.map_version)"
    )


CURRENT_VIEWS = {
    "current_trajectories": _current("trajectories", "vehicle", "boot_id"),
    "current_anchors": _current("anchors", "anchor", "image"),
}


def copied_metadata() -> MetaData:
    """The tables as objects of their own, to create them by: GeoAlchemy2 takes columns off a table while it is created,
    and threads share these."""
    copied = MetaData()
    for table in metadata.sorted_tables:
        table.to_metadata(copied)
    return copied


def newest_version() -> Select[tuple[Any, ...]]:
    """The row of the newest version."""
    return select(map_versions).order_by(map_versions.c.map_version.desc()).limit(1)


def versions_around(map_version: int) -> Select[tuple[int]]:
    """The numbers of the first version, of this one if it is there, and of the newest, in order."""
    number = map_versions.c.map_version
    ends = (select(func.min(number)).scalar_subquery(), select(func.max(number)).scalar_subquery())
    return select(number).where(number.in_((*ends, map_version))).order_by(number)
