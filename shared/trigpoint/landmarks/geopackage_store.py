"""The landmark store as one GeoPackage file, which QGIS and GDAL open as it is."""

import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import cast

from sqlalchemy import Connection, Table, delete, insert, select, text

from trigpoint.errors import InputError
from trigpoint.landmarks import geopackage_schema as schema
from trigpoint.landmarks import records, tables
from trigpoint.landmarks.geopackage_file import (
    close,
    database_errors,
    driver_of,
    indexed_at_once,
    insert_reference,
    one_state,
    opened,
    transaction,
)
from trigpoint.landmarks.geopackage_geometry import decoded_point, encoded_point
from trigpoint.landmarks.geopackage_query import (
    ANY_ROW,
    LANDMARK_TABLES,
    WIDEST_INDEXED_DEG,
    MapExtent,
    Validity,
    bound_box,
    bound_values,
    clipped,
    grid_window,
    held_extent,
    landmark_sql,
    query_shape,
)
from trigpoint.landmarks.landmark_record import COLUMNS, LandmarkRecord, landmark_of, record_of
from trigpoint.landmarks.model import Checkpoint, Landmark, LandmarkChanges, MapChange, MapRow, MapVersion
from trigpoint.landmarks.queries import (
    DegreeBox,
    LandmarkQuery,
    area_box,
    require_known_version,
    require_next_version,
)
from trigpoint.landmarks.selection import answer_of, changes_of

INSERT_SQL = f"INSERT INTO landmarks ({', '.join(COLUMNS)}) VALUES ({', '.join('?' * len(COLUMNS))})"
HISTORY_SQL = tuple(f"SELECT {', '.join(COLUMNS)} FROM {one.name} WHERE landmark = ?" for one in LANDMARK_TABLES)
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


class GeoPackageStore:
    """A LandmarkStore in the file at `path`; see `opened` for what that raises. Not for several threads at once."""

    def __init__(self, path: Path, *, read_only: bool = False) -> None:
        self._path = path
        self._connection: Connection = opened(path, read_only=read_only)
        self._driver = driver_of(self._connection)
        self._extent: tuple[int, MapExtent | None] | None = None

    def apply(self, change: MapChange, checkpoint: Checkpoint) -> None:
        """One map version and its checkpoint in one transaction."""
        self.apply_all((change,), checkpoint)

    def apply_all(self, changes: Sequence[MapChange], checkpoint: Checkpoint) -> None:
        """Consecutive map versions and their checkpoint in one transaction."""
        with database_errors(self._path), transaction(self._connection):
            held = self._newest()
            for change in changes:
                require_next_version(change.version, held)
                if not held:
                    self._adopt_crs(change.version.crs)
                self._write(change)
                held = (change.version,)
            self._write_checkpoint(checkpoint)
            self._date_layers(changes[-1].version.solved_ns)
        self._extent = None

    def defer_indexes(self) -> None:
        """Nothing: an index takes in the rows of a version together, which is fast enough."""

    def restore_indexes(self) -> None:
        """Nothing: none was put off."""

    def landmarks(self, query: LandmarkQuery) -> tuple[Landmark, ...]:
        """The landmarks that meet a query."""
        with database_errors(self._path), one_state(self._driver):
            older = query.as_of is not None and self._is_older(query.as_of)
            sources = LANDMARK_TABLES if older else LANDMARK_TABLES[:1]
            validity = Validity(valid_at=query.as_of) if older else ANY_ROW
            return answer_of(lambda asked: self._found_in(sources, asked, validity), query)

    def history(self, landmark: str) -> tuple[Landmark, ...]:
        """Every row a landmark has had, in order of version."""
        with database_errors(self._path):
            found = [row for statement in HISTORY_SQL for row in self._driver.execute(statement, (landmark,))]
        return tuple(sorted(map(_landmark, found), key=lambda row: row.valid_from_version))

    def changes(self, query: LandmarkQuery, *, since: int) -> LandmarkChanges:
        """What changed since a version among the landmarks that meet a query."""
        with database_errors(self._path), one_state(self._driver):
            return changes_of(self, query, since=since)

    def known_versions(self, around: int) -> tuple[int, ...]:
        """The numbers of the first version, of this one if it is there, and of the newest, in order."""
        return tuple(self._connection.scalars(tables.versions_around(around)))

    def ended(self, query: LandmarkQuery, *, since: int, as_of: int) -> list[Landmark]:
        """Rows valid at version `since`, and not any more at `as_of`."""
        return self._found_in(LANDMARK_TABLES[1:], query, Validity(valid_at=since, ended_by=as_of))

    def opened(self, query: LandmarkQuery, *, since: int, as_of: int) -> list[Landmark]:
        """Rows valid at version `as_of`, and not yet at `since`."""
        return self._found_in(LANDMARK_TABLES, query, Validity(valid_at=as_of, opened_after=since))

    def map_versions(self) -> tuple[MapVersion, ...]:
        """All map versions in order."""
        with database_errors(self._path):
            return self._versions()

    def newest_version(self) -> MapVersion | None:
        """The newest map version."""
        with database_errors(self._path):
            return next(iter(self._newest()), None)

    def checkpoint(self) -> Checkpoint:
        """How far the log has been taken in."""
        held = select(tables.checkpoints.c.stream, tables.checkpoints.c.next_number)
        with database_errors(self._path):
            return Checkpoint(tuple(sorted((stream, number) for stream, number in self._connection.execute(held))))

    def rows(self) -> Iterator[MapRow]:
        """Every row of every version."""
        with database_errors(self._path):
            yield from self._versions()
            for source in LANDMARK_TABLES:
                yield from self._found(source, LandmarkQuery(), ANY_ROW)
            yield from map(records.trajectory_of, self._records(tables.trajectories))
            yield from map(records.anchor_of, self._records(tables.anchors))
            yield from map(records.image_offset_of, self._records(tables.image_offsets))
            yield from map(records.label_gain_of, self._records(tables.label_gains))

    def damage(self) -> tuple[str, ...]:
        """What SQLite finds wrong with the file and its spatial indexes; nothing for a sound one."""
        indexes = (schema.rtree_name(layer.name) for layer in schema.FEATURE_LAYERS if layer.indexed)
        statements = ("PRAGMA integrity_check", *(f"SELECT rtreecheck('{index}')" for index in indexes))
        with database_errors(self._path):
            said = [row[0] for statement in statements for row in self._connection.execute(text(statement))]
        return tuple(line for line in said if line != "ok")

    def close(self) -> None:
        """The file closed."""
        close(self._connection)

    def _records(self, source: Table) -> Iterator[records.Record]:
        for record in self._connection.execute(select(source)).mappings():
            yield dict(record)

    def _versions(self) -> tuple[MapVersion, ...]:
        ordered = select(tables.map_versions).order_by(tables.map_versions.c.map_version)
        return tuple(records.map_version_of(dict(record)) for record in self._connection.execute(ordered).mappings())

    def _newest(self) -> tuple[MapVersion, ...]:
        """The newest version, none before the first."""
        found = self._connection.execute(tables.newest_version()).mappings()
        return tuple(records.map_version_of(dict(record)) for record in found)

    def _is_older(self, as_of: int) -> bool:
        known = self.known_versions(as_of)
        require_known_version(as_of, known)
        return as_of < known[-1]

    def _found_in(self, sources: Sequence[Table], query: LandmarkQuery, validity: Validity) -> list[Landmark]:
        return [landmark for source in sources for landmark in self._found(source, query, validity)]

    def _found(self, source: Table, query: LandmarkQuery, validity: Validity) -> Iterable[Landmark]:
        bound = bound_values(query, validity)
        box = area_box(query)
        window = None
        if box is not None:
            window = self._window(box)
            bound |= bound_box(box) | (window or {})
        shape = query_shape(query, validity, windowed=window is not None, boxed=box is not None)
        return map(_landmark, self._driver.execute(landmark_sql(source, shape), bound))

    def _window(self, box: DegreeBox) -> dict[str, float] | None:
        """The grid window to look a box up in; None where the index cannot serve and columns must."""
        extent = self._held_extent()
        inside = None if extent is None else clipped(box, extent.box)
        if extent is None or inside is None or extent.box.lon_max_deg - extent.box.lon_min_deg > WIDEST_INDEXED_DEG:
            return None
        return grid_window(inside, extent.crs)

    def _held_extent(self) -> MapExtent | None:
        """The map's extent, looked up anew whenever another process has written."""
        (data_version,) = self._driver.execute("PRAGMA data_version").fetchone()
        if self._extent is None or self._extent[0] != data_version:
            self._extent = (data_version, held_extent(self._driver))
        return self._extent[1]

    def _adopt_crs(self, crs: str) -> None:
        reference = schema.spatial_reference_of(crs)
        insert_reference(self._connection, reference)
        self._driver.execute("UPDATE gpkg_contents SET srs_id = ? WHERE data_type = 'features'", (reference.srs_id,))
        self._driver.execute("UPDATE gpkg_geometry_columns SET srs_id = ?", (reference.srs_id,))

    def _write(self, change: MapChange) -> None:
        srs_id = schema.spatial_reference_of(change.version.crs).srs_id
        self._insert(tables.map_versions, [records.plain_record(change.version)])
        self._close_landmarks(change.closed, change.version.map_version)
        self._open_landmarks(change, srs_id)
        self._insert(tables.trajectories, [records.trajectory_record(row, srs_id) for row in change.trajectories])
        self._insert(tables.anchors, [records.anchor_record(row, srs_id) for row in change.anchors])
        self._insert(tables.image_offsets, [records.plain_record(row) for row in change.image_offsets])
        self._insert(tables.label_gains, [records.plain_record(row) for row in change.label_gains])

    def _open_landmarks(self, change: MapChange, srs_id: int) -> None:
        values = (
            record_of(landmark, encoded_point(landmark.easting_m, landmark.northing_m, srs_id=srs_id))
            for landmark in change.opened
        )
        try:
            with indexed_at_once(self._driver, "landmarks"):
                self._driver.executemany(INSERT_SQL, values)
        except sqlite3.IntegrityError as error:
            reason = f"map version {change.version.map_version} opens a landmark still valid: {error}"
            raise InputError(reason) from error

    def _insert(self, target: Table, rows: Sequence[records.Record]) -> None:
        if rows:
            self._connection.execute(insert(target), rows)

    def _close_landmarks(self, landmarks: Sequence[str], map_version: int) -> None:
        columns = ", ".join(name for name in COLUMNS if name != "valid_to_version")
        with indexed_at_once(self._driver, "landmark_history"):
            moved = self._driver.executemany(
                f"INSERT INTO landmark_history ({columns}, valid_to_version) "
                f"SELECT {columns}, ? FROM landmarks WHERE landmark = ?",
                [(map_version, landmark) for landmark in landmarks],
            ).rowcount
        if landmarks and moved != len(landmarks):
            raise InputError(f"map version {map_version} closes {len(landmarks)} landmarks: {moved} are valid")
        self._driver.executemany("DELETE FROM landmarks WHERE landmark = ?", [(landmark,) for landmark in landmarks])

    def _write_checkpoint(self, checkpoint: Checkpoint) -> None:
        self._connection.execute(delete(tables.checkpoints))
        self._insert(
            tables.checkpoints,
            [{"stream": stream, "next_number": number} for stream, number in checkpoint.next_numbers],
        )

    def _date_layers(self, solved_ns: int) -> None:
        """The layers' extents, and the time they changed: the version's own, so that a replay writes the same."""
        changed = (EPOCH + timedelta(microseconds=solved_ns // 1000)).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z"
        self._driver.execute("UPDATE gpkg_contents SET last_change = ?", (changed,))
        for layer in schema.FEATURE_LAYERS:
            index = schema.rtree_name(layer.name.removeprefix("current_"))
            box = self._driver.execute(f"SELECT min(minx), min(miny), max(maxx), max(maxy) FROM {index}").fetchone()
            self._driver.execute(
                "UPDATE gpkg_contents SET min_x = ?, min_y = ?, max_x = ?, max_y = ? WHERE table_name = ?",
                (*box, layer.name),
            )


def _landmark(record: tuple[bytes, *tuple[object, ...]]) -> Landmark:
    easting_m, northing_m = decoded_point(record[0])
    return landmark_of(cast(LandmarkRecord, record), easting_m=easting_m, northing_m=northing_m)
