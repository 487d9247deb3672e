"""The landmark map: what is valid and what was, paths, anchors, image offsets, versions, and the log's checkpoint."""

import sqlalchemy as sa
from alembic import op
from geoalchemy2 import Geometry
from sqlalchemy.schema import SchemaItem

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

TABLES = (
    "landmarks",
    "landmark_history",
    "trajectories",
    "anchors",
    "image_offsets",
    "map_versions",
    "log_checkpoints",
)
INDEXED = ("landmarks", "landmark_history", "trajectories", "anchors")
PLACE = "(ST_SetSRID(ST_MakePoint(lon_deg, lat_deg), 4326)::geography)"


def upgrade() -> None:
    """Tables, their spatial indexes, and views of the newest version."""
    op.execute("CREATE EXTENSION IF NOT EXISTS postgis")
    for name in ("landmarks", "landmark_history"):
        op.create_table(name, *_landmark_columns(), _unique(name))
    op.create_table("trajectories", *_trajectory_columns())
    op.create_table("anchors", *_anchor_columns())
    op.create_table("image_offsets", *_offset_columns())
    op.create_table("map_versions", *_version_columns())
    op.create_table("log_checkpoints", _feature_id(), _text("stream"), _whole("next_number"), _key("stream"))
    for name in INDEXED:
        op.execute(f"CREATE INDEX {name}_geom ON {name} USING gist (geom)")
    op.execute(f"CREATE INDEX landmarks_place ON landmarks USING gist ({PLACE})")
    _create_view("trajectories", "vehicle", "boot_id")
    _create_view("anchors", "anchor", "image")


def downgrade() -> None:
    """Nothing of the map is left; the log still has it."""
    op.execute("DROP VIEW current_trajectories, current_anchors")
    for name in TABLES:
        op.drop_table(name)


def _create_view(table: str, *key: str) -> None:
    same = " AND ".join(f"later.{column} = {table}.{column}" for column in key)
    op.execute(
        f"CREATE VIEW current_{table} AS SELECT * FROM {table} "
        "WHERE map_version >= (SELECT max(map_version) FROM map_versions WHERE base_version = 0) "
        f"AND NOT EXISTS (SELECT 1 FROM {table} later WHERE {same} AND later.map_version > {table}.map_version)"
    )


def _feature_id() -> SchemaItem:
    return sa.Column("fid", sa.BigInteger, primary_key=True)


def _geometry(kind: str, *, nullable: bool) -> SchemaItem:
    return sa.Column("geom", Geometry(kind, srid=-1, spatial_index=False), nullable=nullable)


def _whole(name: str, *, nullable: bool = False) -> SchemaItem:
    return sa.Column(name, sa.BigInteger, nullable=nullable)


def _real(name: str, *, nullable: bool = False) -> SchemaItem:
    return sa.Column(name, sa.Double, nullable=nullable)


def _text(name: str) -> SchemaItem:
    return sa.Column(name, sa.Text, nullable=False)


def _key(*columns: str) -> SchemaItem:
    return sa.UniqueConstraint(*columns)


def _covariance() -> list[SchemaItem]:
    return [_real(name) for name in ("variance_x_m2", "covariance_xy_m2", "variance_y_m2")]


def _unique(name: str) -> SchemaItem:
    return _key("landmark") if name == "landmarks" else _key("landmark", "valid_from_version")


def _landmark_columns() -> list[SchemaItem]:
    return [
        _feature_id(),
        _geometry("POINT", nullable=False),
        *(_text(name) for name in ("landmark", "kind", "signature")),
        *(_real(name) for name in ("x_m", "y_m", "lat_deg", "lon_deg")),
        *_covariance(),
        *(_real(name) for name in ("sigma_major_m", "sigma_minor_m", "ellipse_heading_rad")),
        _whole("observation_count"),
        _text("vehicles"),
        _whole("first_seen_ns"),
        _whole("last_seen_ns"),
        sa.Column("anchored", sa.Boolean, nullable=False),
        _text("anchors"),
        _text("provenance"),
        _whole("valid_from_version"),
        _whole("valid_to_version", nullable=True),
    ]


def _trajectory_columns() -> list[SchemaItem]:
    return [
        _feature_id(),
        _geometry("LINESTRING", nullable=True),
        _whole("map_version"),
        _text("vehicle"),
        _text("boot_id"),
        _whole("first_stamp_ns"),
        _whole("last_stamp_ns"),
        _whole("pose_count"),
        _real("length_m"),
        _text("calibration_json"),
        _key("vehicle", "boot_id", "map_version"),
    ]


def _anchor_columns() -> list[SchemaItem]:
    return [
        _feature_id(),
        _geometry("POINT", nullable=True),
        _whole("map_version"),
        *(_text(name) for name in ("anchor", "image", "kind", "signature", "landmark", "reason")),
        *(_real(name, nullable=True) for name in ("sigma_m", "residual_x_m", "residual_y_m", "residual_m")),
        *(_real(name, nullable=True) for name in ("lat_deg", "lon_deg")),
        _key("anchor", "image", "map_version"),
    ]


def _offset_columns() -> list[SchemaItem]:
    return [
        _feature_id(),
        _whole("map_version"),
        _text("image"),
        _real("offset_x_m"),
        _real("offset_y_m"),
        *_covariance(),
        _key("image", "map_version"),
    ]


def _version_columns() -> list[SchemaItem]:
    return [
        sa.Column("map_version", sa.BigInteger, primary_key=True, autoincrement=False),
        _whole("base_version"),
        *(_text(name) for name in ("method", "settings_json", "inputs_json")),
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
    ]
