"""What each log file and chunk holds, in SQLite: a projection of the files, rebuilt from them at any time.

Every row has a checksum, and a catalog that is damaged, taken away or another one by now is begun anew.
"""

import fcntl
import sqlite3
import threading
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from trigpoint.logs.channels import ChannelKey

AnswerT = TypeVar("AnswerT")

NAME = "catalog.sqlite"
LOCK_NAME = ".catalog-lock"  # held by whoever takes a damaged catalog away
LAYOUT = 2  # PRAGMA user_version; another one is rebuilt
WAIT_S = 10.0  # for another process's transaction
CHECKED_BYTES = 64 * 1024 * 1024  # a catalog up to this size is checked when it is opened, in about a tenth of a second
ENVIRONMENT_CODES = frozenset(  # what SQLite says about disk, memory and other processes, not about the file's content
    {
        sqlite3.SQLITE_BUSY,
        sqlite3.SQLITE_LOCKED,
        sqlite3.SQLITE_NOMEM,
        sqlite3.SQLITE_READONLY,
        sqlite3.SQLITE_FULL,
        sqlite3.SQLITE_CANTOPEN,
        sqlite3.SQLITE_PERM,
        sqlite3.SQLITE_IOERR,
    }
)
UNREADABLE = (sqlite3.Error, ValueError, TypeError, OverflowError)  # what SQLite's adapter meets in a damaged file
STATEMENTS = """
CREATE TABLE file (
  stream TEXT NOT NULL, first_number INTEGER NOT NULL, size_bytes INTEGER NOT NULL, finished INTEGER NOT NULL,
  damage TEXT NOT NULL, checksum INTEGER NOT NULL, PRIMARY KEY (stream, first_number)) WITHOUT ROWID;
CREATE TABLE chunk (
  stream TEXT NOT NULL, first_number INTEGER NOT NULL, number INTEGER NOT NULL, count INTEGER NOT NULL,
  start_ns INTEGER NOT NULL, end_ns INTEGER NOT NULL, offset INTEGER NOT NULL, length INTEGER NOT NULL,
  channel_ids TEXT NOT NULL, checksum INTEGER NOT NULL, PRIMARY KEY (stream, number)) WITHOUT ROWID;
CREATE TABLE channel (
  stream TEXT NOT NULL, first_number INTEGER NOT NULL, id INTEGER NOT NULL, topic TEXT NOT NULL,
  schema_name TEXT NOT NULL, source TEXT NOT NULL, boot_id TEXT NOT NULL, vehicle TEXT NOT NULL,
  sequence_base INTEGER NOT NULL, checksum INTEGER NOT NULL, PRIMARY KEY (stream, first_number, id)) WITHOUT ROWID;
"""


@dataclass(frozen=True, slots=True)
class CatalogFile:
    """A log file by the number of its first event. `size_bytes` as long as it was when looked at; `damage` says
    what of it cannot be read, or nothing."""

    stream: str
    first_number: int
    size_bytes: int
    finished: bool
    damage: str = ""


@dataclass(frozen=True, slots=True)
class CatalogChunk:
    """A chunk of a file: the number of its first event, how many, their times [start, end], and where it stands."""

    first_number: int
    number: int
    count: int
    start_ns: int
    end_ns: int
    offset: int
    length: int
    channel_ids: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class CatalogEntry:
    """A file with all that is in it."""

    file: CatalogFile
    chunks: tuple[CatalogChunk, ...]
    channels: tuple[tuple[int, ChannelKey], ...]


@dataclass(frozen=True, slots=True)
class CatalogGrowth:
    """What came to a file that was known with `known_bytes`, and its state by now."""

    entry: CatalogEntry
    known_bytes: int


@dataclass(frozen=True, slots=True)
class FileContents:
    """A file's share of a log: numbers [first, first + count), times [start, end], vehicles and topics."""

    file: CatalogFile
    count: int
    start_ns: int
    end_ns: int
    vehicles: tuple[str, ...]
    topics: tuple[str, ...]


class CatalogRenewed(Exception):
    """The catalog was damaged, gone or taken away, and is begun anew: to be filled from the files."""


class Catalog:
    """The catalog of one log directory; usable from several threads and beside other processes.

    Whatever is asked raises CatalogRenewed where what the catalog said is lost; asked again it answers as an empty one.
    """

    def __init__(self, path: Path) -> None:
        self._lock = threading.RLock()
        self._path = path
        try:
            self._connection = _connected(path)
        except UNREADABLE as error:
            if not is_damage(error):
                raise
            self._taken_away(path.stat().st_ino)
            self._connection = _connected(path)
        self._file_number = path.stat().st_ino

    def _asked(self, question: Callable[[], AnswerT]) -> AnswerT:
        with self._lock:
            try:
                if self._path.stat().st_ino == self._file_number:
                    return question()
            except FileNotFoundError:
                pass
            except (*UNREADABLE, CatalogDamaged) as error:
                if not is_damage(error):
                    raise
            self._renew()
        raise CatalogRenewed(f"{self._path} begun anew")

    def _renew(self) -> None:
        self._connection.close()
        self._taken_away(self._file_number)
        self._connection = _connected(self._path)
        self._file_number = self._path.stat().st_ino

    def _taken_away(self, file_number: int) -> None:
        """The damaged file removed, unless another process put a new one there by now."""
        with (self._path.with_name(LOCK_NAME)).open("ab") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            with suppress(FileNotFoundError):
                if self._path.stat().st_ino == file_number:
                    for suffix in ("", "-wal", "-shm"):
                        self._path.with_name(self._path.name + suffix).unlink(missing_ok=True)

    def close(self) -> None:
        """The connection closed."""
        self._connection.close()

    def add_all(self, grown: Sequence[CatalogGrowth]) -> None:
        """More chunks and channels of files entered, and their states replaced, in one transaction.

        Raises CatalogRenewed if one of the files is not known with the size it had before.
        """
        self._asked(lambda: self._add_all(grown))

    def _add_all(self, grown: Sequence[CatalogGrowth]) -> None:
        with self._connection:
            for growth in grown:
                key = (growth.entry.file.stream, growth.entry.file.first_number)
                rows = self._rows("SELECT size_bytes FROM file WHERE stream = ? AND first_number = ?", key)
                if rows != [(growth.known_bytes,)]:
                    raise CatalogRenewed(f"{self._path}: {key} is not known with {growth.known_bytes} bytes")
            self._insert([growth.entry for growth in grown])

    def replace(self, entry: CatalogEntry) -> None:
        """All that was known of a file replaced by this, in one transaction; not where more of its chunks are known.

        They were durable once: the file lost them, or its writer was faster than whoever read it.
        """
        self._asked(lambda: self._replace(entry))

    def _replace(self, entry: CatalogEntry) -> None:
        with self._connection:
            self._connection.execute("BEGIN IMMEDIATE")
            if self._chunk_count(entry.file) <= len(entry.chunks):
                self._delete(entry.file)
                self._insert([entry])

    def remove(self, file: CatalogFile) -> None:
        """A file forgotten with all that was in it."""

        def removed() -> None:
            with self._connection:
                self._delete(file)

        self._asked(removed)

    def _insert(self, entries: Sequence[CatalogEntry]) -> None:
        execute_many = self._connection.executemany
        keys = [(entry, (entry.file.stream, entry.file.first_number)) for entry in entries]
        execute_many(
            "INSERT OR REPLACE INTO file VALUES (?, ?, ?, ?, ?, ?)",
            [_checked((*key, *_file_values(entry.file))) for entry, key in keys],
        )
        execute_many(
            "INSERT OR REPLACE INTO chunk VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            [_checked((*key, *_chunk_values(chunk))) for entry, key in keys for chunk in entry.chunks],
        )
        execute_many(
            "INSERT OR REPLACE INTO channel VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            [_checked((*key, number, *_channel_values(one))) for entry, key in keys for number, one in entry.channels],
        )

    def _chunk_count(self, file: CatalogFile) -> int:
        statement = "SELECT COUNT(*) FROM chunk WHERE stream = ? AND first_number = ?"
        return int(self._rows(statement, (file.stream, file.first_number))[0][0])

    def _delete(self, file: CatalogFile) -> None:
        for table in ("file", "chunk", "channel"):
            statement = f"DELETE FROM {table} WHERE stream = ? AND first_number = ?"
            self._connection.execute(statement, (file.stream, file.first_number))

    def files(self, stream: str) -> tuple[CatalogFile, ...]:
        """The files of a stream, in order."""
        rows = self._checked_rows("SELECT * FROM file WHERE stream = ? ORDER BY first_number", (stream,))
        return tuple(CatalogFile(row[0], row[1], row[2], bool(row[3]), row[4]) for row in rows)

    def last_file(self, stream: str) -> CatalogFile | None:
        """The file of a stream with the highest numbers, if there is any."""
        statement = "SELECT * FROM file WHERE stream = ? ORDER BY first_number DESC LIMIT 1"
        rows = self._checked_rows(statement, (stream,))
        return CatalogFile(rows[0][0], rows[0][1], rows[0][2], bool(rows[0][3]), rows[0][4]) if rows else None

    def chunks(
        self, stream: str, *, first_number: int = 0, from_ns: int | None = None, until_ns: int | None = None
    ) -> tuple[CatalogChunk, ...]:
        """The chunks with an event of this number or later that may be of the half-open time range, in order."""
        rows = self._checked_rows(
            "SELECT * FROM chunk WHERE stream = ?1 AND number + count > ?2"
            " AND number >= IFNULL((SELECT MAX(number) FROM chunk WHERE stream = ?1 AND number <= ?2), 0)"
            " AND (?3 IS NULL OR end_ns >= ?3) AND (?4 IS NULL OR start_ns < ?4) ORDER BY number",
            (stream, first_number, from_ns, until_ns),
        )
        return tuple(_chunk_of(*row[1:]) for row in rows)

    def file_chunks(self, stream: str, first_number: int) -> tuple[CatalogChunk, ...]:
        """The chunks of the file with this first number, in order."""
        statement = "SELECT * FROM chunk WHERE stream = ? AND first_number = ? ORDER BY number"
        return tuple(_chunk_of(*row[1:]) for row in self._checked_rows(statement, (stream, first_number)))

    def channels(self, stream: str, first_number: int) -> dict[int, ChannelKey]:
        """The channels of the file with this first number."""
        statement = "SELECT * FROM channel WHERE stream = ? AND first_number = ? ORDER BY id"
        return {row[2]: ChannelKey(*row[3:]) for row in self._checked_rows(statement, (stream, first_number))}

    def boots(self, stream: str) -> list[tuple[str, str, int, int]]:
        """Source, boot and closed time range of the chunks with events of that boot, in order of time."""
        statement = (
            "SELECT source, boot_id, MIN(start_ns), MAX(end_ns) FROM channel JOIN chunk USING (stream, first_number)"
            " WHERE stream = ? AND instr(' ' || channel_ids || ' ', ' ' || id || ' ') > 0"
            " GROUP BY source, boot_id ORDER BY 3, 1, 2"
        )
        return self._asked(lambda: self._rows(statement, (stream,)))

    def next_number(self, stream: str) -> int:
        """One more than the highest number known of a stream."""
        statement = "SELECT * FROM chunk WHERE stream = ? ORDER BY number DESC LIMIT 1"
        chunks = [_chunk_of(*row[1:]) for row in self._checked_rows(statement, (stream,))]
        return chunks[0].number + chunks[0].count if chunks else 0

    def first_number(self, stream: str) -> int | None:
        """The lowest number known of a stream, None if there is none."""
        statement = "SELECT * FROM chunk WHERE stream = ? ORDER BY number LIMIT 1"
        rows = self._checked_rows(statement, (stream,))
        return int(rows[0][2]) if rows else None

    def streams(self) -> tuple[str, ...]:
        """All streams that hold an event, sorted."""
        statement = "SELECT DISTINCT stream FROM chunk ORDER BY stream"
        return tuple(row[0] for row in self._asked(lambda: self._rows(statement, ())))

    def contents(self, stream: str) -> tuple[FileContents, ...]:
        """What each file of a stream holds, in order."""
        return tuple(self._contents(file) for file in self.files(stream))

    def _contents(self, file: CatalogFile) -> FileContents:
        channels = self.channels(file.stream, file.first_number).values()
        chunks = self.file_chunks(file.stream, file.first_number)
        return FileContents(
            file=file,
            count=sum(chunk.count for chunk in chunks),
            start_ns=min((chunk.start_ns for chunk in chunks), default=0),
            end_ns=max((chunk.end_ns for chunk in chunks), default=0),
            vehicles=tuple(sorted({channel.vehicle for channel in channels} - {""})),
            topics=tuple(sorted({channel.topic for channel in channels})),
        )

    def _checked_rows(self, statement: str, values: Sequence[object]) -> list[tuple[Any, ...]]:
        """The rows without their checksums."""
        return self._asked(lambda: [_intact(row) for row in self._rows(statement, values)])

    def _rows(self, statement: str, values: Sequence[object]) -> list[tuple[Any, ...]]:
        return self._connection.execute(statement, values).fetchall()


def renewed_once(question: Callable[[], AnswerT]) -> AnswerT:
    """The answer, of the second try where the catalog was begun anew at the first."""
    try:
        return question()
    except CatalogRenewed:
        return question()


class CatalogDamaged(Exception):
    """A row is not as it was written."""


def checked_rows(connection: sqlite3.Connection, table: str) -> Iterator[tuple[Any, ...]]:
    """Every row of a table without its checksum. Raises CatalogDamaged."""
    for row in connection.execute(f"SELECT * FROM {table}"):
        yield _intact(row)


def is_damage(error: Exception) -> bool:
    """Whether it is the catalog's content that is wrong, not that it is busy or the disk full or failing."""
    code = getattr(error, "sqlite_errorcode", None)
    if isinstance(error, sqlite3.ProgrammingError):
        return False
    return code is None or code & 0xFF not in ENVIRONMENT_CODES


def _checked(values: tuple[object, ...]) -> tuple[object, ...]:
    """The row with its checksum."""
    return (*values, zlib.crc32(repr(values).encode("utf-8", "surrogatepass")))


def _intact(row: tuple[Any, ...]) -> tuple[Any, ...]:
    """The row without its checksum. Raises CatalogDamaged if that is another one."""
    if _checked(row[:-1]) != row:
        raise CatalogDamaged(f"row {row[:3]} has another checksum")
    return row[:-1]


def _connected(path: Path) -> sqlite3.Connection:
    """A connection to a catalog of the present layout. Durability is the log files': nothing waits for the disk."""
    connection = sqlite3.connect(path, timeout=WAIT_S, check_same_thread=False)
    try:
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = OFF")
        if _layout(connection) != LAYOUT:
            _lay_out(connection)
        elif path.stat().st_size <= CHECKED_BYTES:
            for (fault,) in connection.execute("PRAGMA integrity_check(1)"):
                if fault != "ok":
                    raise sqlite3.DatabaseError(f"{path}: {fault}")
    except UNREADABLE:
        connection.close()
        raise
    return connection


def _layout(connection: sqlite3.Connection) -> int:
    (layout,) = connection.execute("PRAGMA user_version").fetchone()
    return int(layout)


def _lay_out(connection: sqlite3.Connection) -> None:
    """Empty tables; those of another layout are gone, unless another process was faster."""
    with connection:
        connection.execute("BEGIN IMMEDIATE")
        if _layout(connection) == LAYOUT:
            return
        for table in ("file", "chunk", "channel"):
            connection.execute(f"DROP TABLE IF EXISTS {table}")
        for statement in STATEMENTS.split(";"):
            connection.execute(statement)
        connection.execute(f"PRAGMA user_version = {LAYOUT}")


def _chunk_of(*values: Any) -> CatalogChunk:
    *numbers, channel_ids = values
    return CatalogChunk(*numbers, tuple(map(int, channel_ids.split())))  # type: ignore[call-arg]  # a row has 8


def _file_values(file: CatalogFile) -> tuple[object, ...]:
    return file.size_bytes, int(file.finished), file.damage


def _chunk_values(chunk: CatalogChunk) -> tuple[object, ...]:
    place = (chunk.number, chunk.count, chunk.start_ns, chunk.end_ns, chunk.offset, chunk.length)
    return (*place, " ".join(map(str, chunk.channel_ids)))


def _channel_values(channel: ChannelKey) -> tuple[object, ...]:
    names = (channel.topic, channel.schema_name, channel.source, channel.boot_id, channel.vehicle)
    return (*names, channel.sequence_base)
