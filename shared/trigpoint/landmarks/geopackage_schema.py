"""What makes an SQLite file a GeoPackage: OGC 12-128r18 (version 1.4), with the R*Tree extension (annex F.3)."""

from collections.abc import Iterator
from dataclasses import dataclass

from trigpoint.geodesy.projection import WGS84, crs_definition

APPLICATION_ID = 0x47504B47  # "GPKG"
USER_VERSION = 10400  # 1.4
UNDEFINED_CARTESIAN = -1
FIRST_PRIVATE_SRS_ID = 100_000  # clear of EPSG's codes
RTREE_DEFINITION = "http://www.geopackage.org/spec120/#extension_rtree"

SYSTEM_TABLES = (
    """CREATE TABLE gpkg_spatial_ref_sys (srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY,
    organization TEXT NOT NULL, organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL,
    description TEXT)""",
    """CREATE TABLE gpkg_contents (table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL,
    identifier TEXT UNIQUE, description TEXT DEFAULT '',
    last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
    min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER,
    CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id))""",
    """CREATE TABLE gpkg_geometry_columns (table_name TEXT NOT NULL, column_name TEXT NOT NULL,
    geometry_type_name TEXT NOT NULL, srs_id INTEGER NOT NULL, z TINYINT NOT NULL, m TINYINT NOT NULL,
    CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name),
    CONSTRAINT uk_gc_table_name UNIQUE (table_name),
    CONSTRAINT fk_gc_tn FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name),
    CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys (srs_id))""",
    """CREATE TABLE gpkg_extensions (table_name TEXT, column_name TEXT, extension_name TEXT NOT NULL,
    definition TEXT NOT NULL, scope TEXT NOT NULL,
    CONSTRAINT ge_tce UNIQUE (table_name, column_name, extension_name))""",
)


@dataclass(frozen=True, slots=True)
class FeatureLayer:
    """A table or view GIS programs show: its geometry's name, and what is said of it."""

    name: str
    geometry_name: str
    description: str
    indexed: bool = True


@dataclass(frozen=True, slots=True)
class AttributeLayer:
    """A table without geometry, and what is said of it."""

    name: str
    description: str


@dataclass(frozen=True, slots=True)
class SpatialReference:
    """A row of gpkg_spatial_ref_sys."""

    name: str
    srs_id: int
    organization: str
    organization_code: int
    definition: str


FEATURE_LAYERS = (
    FeatureLayer("landmarks", "POINT", "Landmarks of the newest map version"),
    FeatureLayer("landmark_history", "POINT", "Landmarks that were valid up to an earlier map version"),
    FeatureLayer("trajectories", "LINESTRING", "Paths of all drives, in every map version"),
    FeatureLayer("anchors", "POINT", "Labelled anchors and their residuals, in every map version"),
    FeatureLayer("current_trajectories", "LINESTRING", "Paths of all drives in the newest map version", indexed=False),
    FeatureLayer("current_anchors", "POINT", "Anchors and their residuals in the newest map version", indexed=False),
)
ATTRIBUTE_LAYERS = (
    AttributeLayer("map_versions", "Every map version: method, settings, inputs, frame"),
    AttributeLayer("image_offsets", "Offsets of the aerial images, in every map version"),
    AttributeLayer("label_gains", "What one more label would tell, in every map version solved whole"),
    AttributeLayer("log_checkpoints", "How far the event log has been taken in"),
)


def spatial_reference_of(crs: str) -> SpatialReference:
    """How a map's CRS is named in the file: by its EPSG code, else by a number of the file's own."""
    known = crs_definition(crs)
    if known.authority == "EPSG":
        return SpatialReference(known.name, known.code, "EPSG", known.code, known.wkt)
    return SpatialReference(known.name, FIRST_PRIVATE_SRS_ID, "NONE", FIRST_PRIVATE_SRS_ID, known.wkt)


def required_references() -> tuple[SpatialReference, ...]:
    """The three that every GeoPackage has."""
    return (
        SpatialReference("Undefined Cartesian SRS", UNDEFINED_CARTESIAN, "NONE", UNDEFINED_CARTESIAN, "undefined"),
        SpatialReference("Undefined geographic SRS", 0, "NONE", 0, "undefined"),
        spatial_reference_of(WGS84),
    )


def rtree_name(table: str) -> str:
    """The name of a layer's spatial index."""
    return f"rtree_{table}_geom"


def rtree_statements(table: str, *, user_version: int = USER_VERSION) -> Iterator[str]:
    """The spatial index of a layer and the triggers that keep it true, whoever edits the layer.

    Their names, and what they are for, are those of the file's version of GeoPackage: 1.4 tells rows whose place was
    empty before from others, so that an upsert does not fire a trigger twice.
    """
    index = rtree_name(table)
    box = "ST_MinX(NEW.geom), ST_MaxX(NEW.geom), ST_MinY(NEW.geom), ST_MaxY(NEW.geom)"
    new_is_there = "(NEW.geom NOTNULL AND NOT ST_IsEmpty(NEW.geom))"
    new_is_empty = "(NEW.geom ISNULL OR ST_IsEmpty(NEW.geom))"
    old_is_there = "(OLD.geom NOTNULL AND NOT ST_IsEmpty(OLD.geom))"
    old_is_empty = "(OLD.geom ISNULL OR ST_IsEmpty(OLD.geom))"
    put, drop = f"INSERT OR REPLACE INTO {index} VALUES (NEW.fid, {box});", f"DELETE FROM {index} WHERE id = OLD.fid;"
    both = f"DELETE FROM {index} WHERE id IN (OLD.fid, NEW.fid);"
    yield f"CREATE VIRTUAL TABLE {index} USING rtree(id, minx, maxx, miny, maxy)"
    if user_version >= USER_VERSION:
        moved: tuple[tuple[str, str, str, str], ...] = (
            ("update6", "UPDATE OF geom", f"OLD.fid = NEW.fid AND {new_is_there} AND {old_is_there}", put),
            ("update7", "UPDATE OF geom", f"OLD.fid = NEW.fid AND {new_is_there} AND {old_is_empty}", put),
        )
    else:
        moved = (("update1", "UPDATE OF geom", f"OLD.fid = NEW.fid AND {new_is_there}", put),)
    renumbered = "update5" if user_version >= USER_VERSION else "update3"
    for suffix, event, condition, action in (
        ("insert", "INSERT", new_is_there, put),
        *moved,
        ("update2", "UPDATE OF geom", f"OLD.fid = NEW.fid AND {new_is_empty}", drop),
        (renumbered, "UPDATE", f"OLD.fid != NEW.fid AND {new_is_there}", f"{drop} {put}"),
        ("update4", "UPDATE", f"OLD.fid != NEW.fid AND {new_is_empty}", both),
        ("delete", "DELETE", "OLD.geom NOTNULL", drop),
    ):
        yield f"CREATE TRIGGER {index}_{suffix} AFTER {event} ON {table} WHEN {condition} BEGIN {action} END"
