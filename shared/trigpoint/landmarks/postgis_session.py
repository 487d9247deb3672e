"""One connection to a landmark database on a PostgreSQL server: its errors named, its password told to nobody."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psycopg
from psycopg import errors
from sqlalchemy import URL, Connection, create_engine, make_url, text
from sqlalchemy.exc import ArgumentError, DBAPIError
from sqlalchemy.pool import NullPool

from trigpoint.errors import DatabaseUnavailable, InputError, ServiceError

DRIVER = "postgresql+psycopg"
WRITER_LOCK = 0x7472_6967  # an advisory lock's number: who holds it is the one that writes
CONNECT_TIMEOUT_S = 5
LOCK_TIMEOUT_MS = 5000  # how long another writer, or a reader in the way of a change of the schema, is waited for
SILENCE_MS = 15_000  # a server that acknowledges nothing for so long is gone
SESSION = {
    "connect_timeout": CONNECT_TIMEOUT_S,
    "application_name": "trigpoint",
    "options": f"-c lock_timeout={LOCK_TIMEOUT_MS} -c timezone=UTC",
    "keepalives_idle": 5,
    "keepalives_interval": 2,
    "keepalives_count": 3,
    "tcp_user_timeout": SILENCE_MS,
}
AWAY = (psycopg.OperationalError, psycopg.InterfaceError)  # not there, shut down, busy, full: all may pass


def server_url(url: str, password_file: Path | None = None) -> URL:
    """The URL with the password of the file, if one is named. Raises InputError; no message holds a password."""
    try:
        parsed = make_url(url)
    except (ArgumentError, ValueError) as error:
        raise InputError(f"the database URL cannot be read: {DRIVER}://USER@HOST:PORT/DATABASE is needed") from error
    if parsed.drivername != DRIVER:
        raise InputError(f"database {parsed.drivername!r} is not known: geopackage: and {DRIVER}: are")
    if not parsed.database:
        raise InputError(f"{parsed.render_as_string()} names no database")
    if password_file is None:
        return parsed
    try:
        return parsed.set(password=password_file.read_text(encoding="utf-8").strip("\r\n"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{password_file}: the password cannot be read: {error}") from error


class PostgisSession:
    """A connection that is used by one thread. Once lost it stays lost: what it had locked is not locked any more."""

    def __init__(self, url: URL) -> None:
        self.shown = url.render_as_string(hide_password=True)
        self._lost = ""
        # Every transaction sees one state of the map, however many statements it asks.
        engine = create_engine(url, poolclass=NullPool, connect_args=SESSION, isolation_level="REPEATABLE READ")
        with self._named_errors():
            self._connection = engine.connect()

    @contextmanager
    def transaction(self) -> Iterator[Connection]:
        """All statements inside, or none.

        Raises DatabaseUnavailable where the server is away, busy or full, InputError for a value it cannot hold,
        ServiceError for any other error of it.
        """
        if self._lost:
            raise DatabaseUnavailable(self._lost)
        with self._named_errors(), self._connection.begin():
            yield self._connection

    def become_writer(self) -> None:
        """No other process writes this database while this one is connected. Raises DatabaseUnavailable if one does."""
        with self.transaction() as connection:
            try:
                connection.execute(text(f"SELECT pg_advisory_lock({WRITER_LOCK})"))
            except DBAPIError as error:
                if isinstance(error.orig, errors.LockNotAvailable):
                    raise DatabaseUnavailable(f"landmark database {self.shown}: another process writes it") from error
                raise

    def vacuum(self, *table_names: str) -> None:
        """Dead rows of the tables are swept away, and the planner knows the rest."""
        driver = driver_of(self._connection)
        with self._named_errors():
            driver.rollback()
            driver.autocommit = True
            for name in table_names:
                driver.execute(f"VACUUM (ANALYZE) {name}")
            driver.autocommit = False

    def close(self) -> None:
        """The connection ended; again: no effect."""
        self._lost = self._lost or f"landmark database {self.shown}: it was closed"
        if not self._connection.closed:
            self._connection.invalidate()  # without a word to a server that may be gone
            self._connection.close()

    @contextmanager
    def _named_errors(self) -> Iterator[None]:
        try:
            yield
        except (DBAPIError, psycopg.Error) as error:
            cause = error.orig if isinstance(error, DBAPIError) else error
            line = f"landmark database {self.shown}: {' '.join(str(cause).split())}"
            if isinstance(cause, AWAY):
                self._lost = line
                raise DatabaseUnavailable(line) from error
            if isinstance(cause, psycopg.DataError):
                raise InputError(line) from error
            raise ServiceError(line) from error


def driver_of(connection: Connection) -> "psycopg.Connection[tuple[object, ...]]":
    """The psycopg connection inside."""
    driver = connection.connection.driver_connection
    assert isinstance(driver, psycopg.Connection)
    return driver
