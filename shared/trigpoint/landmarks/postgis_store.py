"""The landmark store in a PostGIS database, for a fleet: many readers, and one process that writes."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from psycopg import errors
from sqlalchemy import BigInteger, Column, Connection, MetaData, Table, Text, delete, insert, select, text
from sqlalchemy.exc import DBAPIError

from trigpoint.errors import InputError
from trigpoint.landmarks import postgis_schema, records, tables
from trigpoint.landmarks.geopackage_query import ANY_ROW, LANDMARK_TABLES, Validity
from trigpoint.landmarks.landmark_record import COLUMNS
from trigpoint.landmarks.model import Checkpoint, Landmark, LandmarkChanges, MapChange, MapRow, MapVersion
from trigpoint.landmarks.net_changes import NetChange, net_change
from trigpoint.landmarks.postgis_copy import copy_landmarks, copy_records, copy_rows
from trigpoint.landmarks.postgis_query import found_landmark, landmark_statement
from trigpoint.landmarks.postgis_session import PostgisSession, driver_of, server_url
from trigpoint.landmarks.queries import LandmarkQuery, require_known_version, require_next_version
from trigpoint.landmarks.selection import answer_of, changes_of

STREAMED = {"stream_results": True}
MOVED = ", ".join(name for name in COLUMNS if name != "valid_to_version")
CLOSINGS = Table("closings", MetaData(), Column("landmark", Text), Column("map_version", BigInteger))
MAKE_CLOSINGS = """CREATE TEMPORARY TABLE IF NOT EXISTS closings
(landmark text NOT NULL, map_version bigint NOT NULL) ON COMMIT DELETE ROWS"""
CLOSE = f"""WITH gone AS (DELETE FROM landmarks USING closings WHERE landmarks.landmark = closings.landmark
RETURNING landmarks.*, closings.map_version)
INSERT INTO landmark_history ({MOVED}, valid_to_version) SELECT {MOVED}, map_version FROM gone"""


class PostgisStore:
    """A LandmarkStore on a server; `url` is postgresql+psycopg://USER@HOST:PORT/DATABASE. Not for several threads.

    Opened to write it brings the schema up to date, and is the only one that writes until it is closed. Raises
    InputError for a URL or password file that cannot be read and for a schema newer than this program; while
    `read_only` also for one that is missing or older. Raises DatabaseUnavailable where the server does not answer, or
    another process writes; from then on every call does, and a new store has to be opened. Raises ServiceError for any
    other error of the server, as where it lacks PostGIS.
    """

    def __init__(self, url: str, *, password_file: Path | None = None, read_only: bool = False) -> None:
        self._session = PostgisSession(server_url(url, password_file))
        try:
            self._prepare(read_only=read_only)
        except BaseException:
            self._session.close()
            raise

    def apply(self, change: MapChange, checkpoint: Checkpoint) -> None:
        """One map version and its checkpoint in one transaction."""
        self.apply_all((change,), checkpoint)

    def apply_all(self, changes: Sequence[MapChange], checkpoint: Checkpoint) -> None:
        """Consecutive map versions and their checkpoint in one transaction."""
        with self._session.transaction() as connection:
            held = _newest(connection)
            if not held:
                postgis_schema.adopt_crs(connection, changes[0].version.crs)
            for change in changes:
                require_next_version(change.version, held)
                held = (change.version,)
            _write(connection, changes)
            _write_checkpoint(connection, checkpoint)

    def defer_indexes(self) -> None:
        """Spatial indexes are gone until they are restored: an index made at once costs a tenth of one kept true.

        They stay where a reader is in the way for longer than a writer waits.
        """
        with self._session.transaction() as connection:
            try:
                connection.execute(text(f"DROP INDEX IF EXISTS {', '.join(postgis_schema.DEFERRED_INDEXES)}"))
            except DBAPIError as error:
                if not isinstance(error.orig, errors.LockNotAvailable):
                    raise

    def restore_indexes(self) -> None:
        """Every spatial index is there; where one was missing, dead rows are swept away too."""
        with self._session.transaction() as connection:
            there = set(
                connection.scalars(text("SELECT indexname FROM pg_indexes WHERE schemaname = current_schema()"))
            )
            missing = [name for name in postgis_schema.DEFERRED_INDEXES if name not in there]
            for name in missing:
                connection.execute(text(f"CREATE INDEX {name} ON {postgis_schema.DEFERRED_INDEXES[name]}"))
        if missing:
            self._session.vacuum(*(source.name for source in LANDMARK_TABLES))

    def landmarks(self, query: LandmarkQuery) -> tuple[Landmark, ...]:
        """The landmarks that meet a query."""
        with self._session.transaction() as connection:
            return _answered(connection, query)

    def history(self, landmark: str) -> tuple[Landmark, ...]:
        """Every row a landmark has had, in order of version."""
        with self._session.transaction() as connection:
            versions = _versions(connection)
            found = []
            for source in LANDMARK_TABLES if versions else ():
                everything = landmark_statement(source, LandmarkQuery(), version=versions[0])
                own = connection.execute(everything.where(source.c.landmark == landmark))
                found += [found_landmark(row) for row in own]
        return tuple(sorted(found, key=lambda row: row.valid_from_version))

    def changes(self, query: LandmarkQuery, *, since: int) -> LandmarkChanges:
        """What changed since a version among the landmarks that meet a query."""
        with self._session.transaction() as connection:
            return changes_of(_OneState(connection), query, since=since)

    def map_versions(self) -> tuple[MapVersion, ...]:
        """All map versions in order."""
        with self._session.transaction() as connection:
            return _versions(connection)

    def newest_version(self) -> MapVersion | None:
        """The newest map version."""
        with self._session.transaction() as connection:
            return next(iter(_newest(connection)), None)

    def checkpoint(self) -> Checkpoint:
        """How far the log has been taken in."""
        held = select(tables.checkpoints.c.stream, tables.checkpoints.c.next_number)
        with self._session.transaction() as connection:
            return Checkpoint(tuple(sorted((stream, number) for stream, number in connection.execute(held))))

    def rows(self) -> Iterator[MapRow]:
        """Every row of every version, all as they are when the first one is asked for."""
        with self._session.transaction() as connection:
            versions = _versions(connection)
            yield from versions
            for source in LANDMARK_TABLES if versions else ():
                everything = landmark_statement(source, LandmarkQuery(), version=versions[0])
                yield from map(found_landmark, connection.execute(everything, execution_options=STREAMED))
            yield from map(records.trajectory_of, _records(connection, tables.trajectories))
            yield from map(records.anchor_of, _records(connection, tables.anchors))
            yield from map(records.image_offset_of, _records(connection, tables.image_offsets))
            yield from map(records.label_gain_of, _records(connection, tables.label_gains))

    def damage(self) -> tuple[str, ...]:
        """Nothing: a server checks its pages itself."""
        return ()

    def close(self) -> None:
        """The connection ended."""
        self._session.close()

    def _prepare(self, *, read_only: bool) -> None:
        if read_only:
            with self._session.transaction() as connection:
                postgis_schema.require_current(connection, self._session.shown)
            return
        self._session.become_writer()
        with self._session.transaction() as connection:
            postgis_schema.upgrade(connection, self._session.shown)


class _OneState:
    """The differing rows of one transaction."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def known_versions(self, around: int) -> tuple[int, ...]:
        return tuple(self._connection.scalars(tables.versions_around(around)))

    def ended(self, query: LandmarkQuery, *, since: int, as_of: int) -> list[Landmark]:
        return _found(self._connection, LANDMARK_TABLES[1:], query, Validity(valid_at=since, ended_by=as_of))

    def opened(self, query: LandmarkQuery, *, since: int, as_of: int) -> list[Landmark]:
        return _found(self._connection, LANDMARK_TABLES, query, Validity(valid_at=as_of, opened_after=since))


def _versions(connection: Connection) -> tuple[MapVersion, ...]:
    ordered = select(tables.map_versions).order_by(tables.map_versions.c.map_version)
    return tuple(records.map_version_of(dict(record)) for record in connection.execute(ordered).mappings())


def _newest(connection: Connection) -> tuple[MapVersion, ...]:
    """The newest version, none before the first."""
    found = connection.execute(tables.newest_version()).mappings()
    return tuple(records.map_version_of(dict(record)) for record in found)


def _answered(connection: Connection, query: LandmarkQuery) -> tuple[Landmark, ...]:
    if query.as_of is not None:
        require_known_version(query.as_of, tuple(connection.scalars(tables.versions_around(query.as_of))))
    newest = _newest(connection)
    if not newest:
        return ()
    older = query.as_of is not None and query.as_of < newest[0].map_version
    sources = LANDMARK_TABLES if older else LANDMARK_TABLES[:1]
    validity = Validity(valid_at=query.as_of) if older else ANY_ROW
    return answer_of(lambda asked: _found(connection, sources, asked, validity), query)


def _found(
    connection: Connection, sources: Sequence[Table], query: LandmarkQuery, validity: Validity
) -> list[Landmark]:
    found: list[Landmark] = []
    for version in _newest(connection):
        for source in sources:
            statement = landmark_statement(source, query, version=version, validity=validity)
            found += [found_landmark(row) for row in connection.execute(statement)]
    return found


def _records(connection: Connection, source: Table) -> Iterator[records.Record]:
    for record in connection.execute(select(source), execution_options=STREAMED).mappings():
        yield dict(record)


def _write(connection: Connection, changes: Sequence[MapChange]) -> None:
    srs_id = postgis_schema.server_reference_of(changes[0].version.crs).srs_id
    driver = driver_of(connection)
    net = net_change(changes)
    copy_records(driver, tables.map_versions, [records.plain_record(change.version) for change in changes])
    _close(connection, net, changes)
    copy_landmarks(driver, tables.landmark_history, net.ended, srs_id=srs_id)
    try:
        copy_landmarks(driver, tables.landmarks, net.opened, srs_id=srs_id)
    except errors.UniqueViolation as error:
        raise InputError(f"{_named(changes)} opens a landmark still valid: {error.diag.message_detail}") from error
    for target, rows in (
        (tables.trajectories, [records.trajectory_record(row, srs_id) for one in changes for row in one.trajectories]),
        (tables.anchors, [records.anchor_record(row, srs_id) for one in changes for row in one.anchors]),
        (tables.image_offsets, [records.plain_record(row) for one in changes for row in one.image_offsets]),
        (tables.label_gains, [records.plain_record(row) for one in changes for row in one.label_gains]),
    ):
        if rows:
            copy_records(driver, target, rows)


def _close(connection: Connection, net: NetChange, changes: Sequence[MapChange]) -> None:
    if not net.closed:
        return
    connection.execute(text(MAKE_CLOSINGS))
    copy_rows(driver_of(connection), CLOSINGS, net.closed.items())
    moved = connection.execute(text(CLOSE)).rowcount
    if moved != len(net.closed):
        raise InputError(f"{_named(changes)} closes {len(net.closed)} landmarks: {moved} are valid")


def _named(changes: Sequence[MapChange]) -> str:
    first, last = changes[0].version.map_version, changes[-1].version.map_version
    return f"map version {first}" if first == last else f"one of the map versions {first} to {last}"


def _write_checkpoint(connection: Connection, checkpoint: Checkpoint) -> None:
    connection.execute(delete(tables.checkpoints))
    rows = [{"stream": stream, "next_number": number} for stream, number in checkpoint.next_numbers]
    if rows:
        connection.execute(insert(tables.checkpoints), rows)
