"""What each log file and chunk holds, in SQLite: a projection of the files, rebuilt from them at any time."""

import sqlite3
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from trigpoint.logs.channels import ChannelKey

NAME = "catalog.sqlite"
LAYOUT = 1  # PRAGMA user_version; another one is rebuilt
WAIT_S = 10.0  # for another process's transaction
STATEMENTS = """
CREATE TABLE file (
  stream TEXT NOT NULL, first_number INTEGER NOT NULL, size_bytes INTEGER NOT NULL, finished INTEGER NOT NULL,
  damage TEXT NOT NULL, PRIMARY KEY (stream, first_number)) WITHOUT ROWID;
CREATE TABLE chunk (
  stream TEXT NOT NULL, first_number INTEGER NOT NULL, number INTEGER NOT NULL, count INTEGER NOT NULL,
  start_ns INTEGER NOT NULL, end_ns INTEGER NOT NULL, offset INTEGER NOT NULL, length INTEGER NOT NULL,
  channel_ids TEXT NOT NULL, PRIMARY KEY (stream, number)) WITHOUT ROWID;
CREATE TABLE channel (
  stream TEXT NOT NULL, first_number INTEGER NOT NULL, id INTEGER NOT NULL, topic TEXT NOT NULL,
  schema_name TEXT NOT NULL, source TEXT NOT NULL, boot_id TEXT NOT NULL, vehicle TEXT NOT NULL,
  sequence_base INTEGER NOT NULL, PRIMARY KEY (stream, first_number, id)) WITHOUT ROWID;
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
class FileContents:
    """A file's share of a log: numbers [first, first + count), times [start, end], vehicles and topics."""

    file: CatalogFile
    count: int
    start_ns: int
    end_ns: int
    vehicles: tuple[str, ...]
    topics: tuple[str, ...]


class Catalog:
    """The catalog of one log directory; usable from several threads and beside other processes."""

    def __init__(self, path: Path) -> None:
        self._lock = threading.RLock()
        self._path = path
        self._connection = self._open()

    def _open(self) -> sqlite3.Connection:
        try:
            return _connected(self._path)
        except sqlite3.DatabaseError as error:
            if isinstance(error, sqlite3.OperationalError):  # busy, no disk: not the file's content
                raise
            for name in (self._path.name, f"{self._path.name}-wal", f"{self._path.name}-shm"):
                self._path.with_name(name).unlink(missing_ok=True)
            return _connected(self._path)

    def close(self) -> None:
        """The connection closed."""
        self._connection.close()

    def add(self, entry: CatalogEntry) -> None:
        """More chunks and channels of a file entered, and its state replaced, in one transaction."""
        with self._lock, self._connection:
            self._insert(entry)

    def replace(self, entry: CatalogEntry) -> None:
        """All that was known of a file replaced by this, in one transaction; not where more of its chunks are known.

        They were durable once: the file lost them, or its writer was faster than whoever read it.
        """
        with self._lock, self._connection:
            self._connection.execute("BEGIN IMMEDIATE")
            if self._chunk_count(entry.file) <= len(entry.chunks):
                self._delete(entry.file)
                self._insert(entry)

    def remove(self, file: CatalogFile) -> None:
        """A file forgotten with all that was in it."""
        with self._lock, self._connection:
            self._delete(file)

    def _insert(self, entry: CatalogEntry) -> None:
        file, execute_many = entry.file, self._connection.executemany
        key = (file.stream, file.first_number)
        execute_many(
            "INSERT OR REPLACE INTO file VALUES (?, ?, ?, ?, ?)",
            [(*key, file.size_bytes, file.finished, file.damage)],
        )
        execute_many(
            "INSERT OR REPLACE INTO chunk VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
            [(*key, *_chunk_values(chunk)) for chunk in entry.chunks],
        )
        execute_many(
            "INSERT OR REPLACE INTO channel VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
            [(*key, channel_id, *_channel_values(channel)) for channel_id, channel in entry.channels],
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
        rows = self._rows("SELECT * FROM file WHERE stream = ? ORDER BY first_number", (stream,))
        return tuple(CatalogFile(row[0], row[1], row[2], bool(row[3]), row[4]) for row in rows)

    def chunks(
        self, stream: str, *, first_number: int = 0, from_ns: int | None = None, until_ns: int | None = None
    ) -> tuple[CatalogChunk, ...]:
        """The chunks with an event of this number or later that may be of the half-open time range, in order."""
        rows = self._rows(
            "SELECT first_number, number, count, start_ns, end_ns, offset, length, channel_ids FROM chunk"
            " WHERE stream = ?1 AND number + count > ?2 AND (?3 IS NULL OR end_ns >= ?3)"
            " AND (?4 IS NULL OR start_ns < ?4) ORDER BY number",
            (stream, first_number, from_ns, until_ns),
        )
        return tuple(_chunk_of(*row) for row in rows)

    def channels(self, stream: str, first_number: int) -> dict[int, ChannelKey]:
        """The channels of the file with this first number."""
        rows = self._rows(
            "SELECT id, topic, schema_name, source, boot_id, vehicle, sequence_base FROM channel"
            " WHERE stream = ? AND first_number = ? ORDER BY id",
            (stream, first_number),
        )
        return {row[0]: ChannelKey(*row[1:]) for row in rows}

    def boots(self, stream: str) -> list[tuple[str, str, int, int]]:
        """Source, boot and closed time range of the chunks with events of that boot, in order of time."""
        return self._rows(
            "SELECT source, boot_id, MIN(start_ns), MAX(end_ns) FROM channel JOIN chunk USING (stream, first_number)"
            " WHERE stream = ? AND instr(' ' || channel_ids || ' ', ' ' || id || ' ') > 0"
            " GROUP BY source, boot_id ORDER BY 3, 1, 2",
            (stream,),
        )

    def next_number(self, stream: str) -> int:
        """One more than the highest number known of a stream."""
        rows = self._rows("SELECT number + count FROM chunk WHERE stream = ? ORDER BY number DESC LIMIT 1", (stream,))
        return int(rows[0][0]) if rows else 0

    def streams(self) -> tuple[str, ...]:
        """All streams that hold an event, sorted."""
        return tuple(row[0] for row in self._rows("SELECT DISTINCT stream FROM chunk ORDER BY stream", ()))

    def contents(self, stream: str) -> tuple[FileContents, ...]:
        """What each file of a stream holds, in order."""
        return tuple(self._contents(file) for file in self.files(stream))

    def _contents(self, file: CatalogFile) -> FileContents:
        channels = self.channels(file.stream, file.first_number).values()
        ((count, start_ns, end_ns),) = self._rows(
            "SELECT COALESCE(SUM(count), 0), COALESCE(MIN(start_ns), 0), COALESCE(MAX(end_ns), 0) FROM chunk"
            " WHERE stream = ? AND first_number = ?",
            (file.stream, file.first_number),
        )
        return FileContents(
            file=file,
            count=count,
            start_ns=start_ns,
            end_ns=end_ns,
            vehicles=tuple(sorted({channel.vehicle for channel in channels} - {""})),
            topics=tuple(sorted({channel.topic for channel in channels})),
        )

    def _rows(self, statement: str, values: Sequence[object]) -> list[tuple[Any, ...]]:
        with self._lock:
            return self._connection.execute(statement, values).fetchall()


def _connected(path: Path) -> sqlite3.Connection:
    """A connection to a catalog of the present layout. Durability is the log files': nothing waits for the disk."""
    connection = sqlite3.connect(path, timeout=WAIT_S, check_same_thread=False)
    try:
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = OFF")
        if _layout(connection) != LAYOUT:
            _lay_out(connection)
    except sqlite3.Error:
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


def _chunk_values(chunk: CatalogChunk) -> tuple[object, ...]:
    place = (chunk.number, chunk.count, chunk.start_ns, chunk.end_ns, chunk.offset, chunk.length)
    return (*place, " ".join(map(str, chunk.channel_ids)))


def _channel_values(channel: ChannelKey) -> tuple[object, ...]:
    return (
        channel.topic,
        channel.schema_name,
        channel.source,
        channel.boot_id,
        channel.vehicle,
        channel.sequence_base,
    )
