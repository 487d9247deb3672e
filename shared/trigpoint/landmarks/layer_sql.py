"""Where the rows of a layer stand and which of them make up a map version, in SQL every database here knows."""

from collections.abc import Mapping
from dataclasses import dataclass

from sqlalchemy import Table

from trigpoint.landmarks import tables

AS_OF = "{as_of}"  # replaced by whatever a database binds the version as


@dataclass(frozen=True, slots=True)
class RowSource:
    """A table that holds rows of a layer, and the condition that a row is part of the version `AS_OF`."""

    table: Table
    at_version: str


def _newest_of(table: Table, *key: str) -> RowSource:
    """The newest row of each key up to a version, none from before the newest version that is whole."""
    name = table.name
    same = " AND ".join(f"later.{column} = {name}.{column}" for column in key)
    whole = f"(SELECT max(map_version) FROM map_versions WHERE base_version = 0 AND map_version <= {AS_OF})"
    later = f"SELECT 1 FROM {name} later WHERE {same} AND later.map_version > {name}.map_version"
    return RowSource(
        table,
        f"{name}.map_version <= {AS_OF} AND {name}.map_version >= {whole} "
        f"AND NOT EXISTS ({later} AND later.map_version <= {AS_OF})",
    )


SOURCES: Mapping[str, tuple[RowSource, ...]] = {
    "landmarks": (
        RowSource(tables.landmarks, f"valid_from_version <= {AS_OF}"),
        RowSource(tables.landmark_history, f"valid_from_version <= {AS_OF} AND valid_to_version > {AS_OF}"),
    ),
    "trajectories": (_newest_of(tables.trajectories, "vehicle", "boot_id"),),
    "anchors": (_newest_of(tables.anchors, "anchor", "image"),),
    "image_offsets": (_newest_of(tables.image_offsets, "image"),),
}
FEATURE_ID: Mapping[str, str] = {
    "landmarks": "landmark",
    "trajectories": "vehicle || ':' || boot_id",
    "anchors": "CASE WHEN image = '' THEN anchor ELSE anchor || '@' || image END",
    "image_offsets": "image",
}
HAS_DEGREES = frozenset({"landmarks", "anchors"})  # their longitude and latitude are columns


def columns_of(table: Table) -> tuple[str, ...]:
    """The names of a table's columns but the row's own number."""
    return tuple(column.name for column in table.columns if column.name != "fid")
