"""Groups of events made durable, then published, then acknowledged: always in this order."""

import errno
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field

import numpy as np

from trigpoint.bus.event_messages import event_message
from trigpoint.bus.ports import Bus, BusMessage, BusRun
from trigpoint.errors import AppendFailed
from trigpoint.events.codec import Event, event_class
from trigpoint.events.envelope import Envelope
from trigpoint.events.keys import key_of
from trigpoint.events.runs import EncodedRun
from trigpoint.events.uplink import observation_key
from trigpoint.logs.ports import EventLog
from trigpoint.observability.metrics import Instruments
from trigpoint_ingest.settings import IngestSettings

DISK_ERRORS = frozenset((errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EROFS))  # room and media: an operator mends them
SQLITE_DISK_ERRORS = frozenset((8, 10, 13))  # SQLITE_READONLY, SQLITE_IOERR, SQLITE_FULL (sqlite.org/rescode.html)
SQLITE_PRIMARY = 0xFF  # bits of the primary code in an extended one
APPEND_THREADS = 16  # streams that wait for the disk at the same time

Row = Envelope[Event] | EncodedRun


@dataclass(slots=True)
class Group:
    """What becomes durable together: rows by stream, and what their vehicles are told then."""

    to_append: dict[str, list[Row]]
    acknowledgements: list[BusMessage]
    appended: list[list[Row]] = field(default_factory=list)


class GroupCommit:
    """Commits groups, one after the other."""

    def __init__(self, log: EventLog, bus: Bus | None, settings: IngestSettings, instruments: Instruments) -> None:
        self._log, self._bus = log, bus
        self._settings, self._instruments = settings, instruments
        self._threads = ThreadPoolExecutor(APPEND_THREADS, thread_name_prefix="append")
        self._following: dict[str, int] = {}  # by stream, the number its next event gets
        self._let_go: set[str] = set()

    def commit(self, group: Group) -> None:
        """All of a group durable, then published, then acknowledged.

        Raises AppendFailed: then nothing of it is published or acknowledged. What was not appended stays in the
        group, to be committed again; what was is not appended twice.
        """
        if group.to_append:
            with self._instruments.fsync_seconds.time():
                self._append_all(group)
        if self._bus is None:
            return
        for rows in group.appended:
            self._publish(self._bus, rows)
        for acknowledgement in group.acknowledgements:
            self._bus.publish(acknowledgement)

    def close(self) -> None:
        """No thread left."""
        self._threads.shutdown()

    def _append_all(self, group: Group) -> None:
        """Every stream's rows appended, side by side, since each waits for the disk. Raises AppendFailed."""
        work = {stream: self._threads.submit(self._append, stream, rows) for stream, rows in group.to_append.items()}
        with ExitStack() as errors:  # of several the last is raised, with the others as its context
            for stream in sorted(work):
                if work[stream].exception() is None:
                    group.appended.append(group.to_append.pop(stream))
                else:
                    errors.callback(work[stream].result)

    def _append(self, stream: str, rows: Sequence[Row]) -> None:
        """The rows appended, without those that an append which failed had made durable nevertheless."""
        if stream not in self._following:
            self._following[stream] = self._log.append(stream, ()).number + 1
        if stream in self._let_go:
            there = self._log.append(stream, ()).number + 1
            rows = rows_behind(rows, there - self._following[stream])
        self._let_go.add(stream)
        self._following[stream] = self._log.append(stream, rows).number + 1
        self._let_go.discard(stream)

    def _publish(self, bus: Bus, rows: Sequence[Row]) -> None:
        """The rows on their keys; where nobody listens to a key, nothing is sent: the log has it."""
        heard: dict[str, bool] = {}
        for row in rows:
            if isinstance(row, EncodedRun):
                for run in self._bus_runs(row):
                    if _is_heard(bus, run.key, heard):
                        bus.publish_run(run)
            else:
                key = key_of(row, root=self._settings.root, map_name=self._settings.map_name)
                if _is_heard(bus, key, heard):
                    bus.publish(event_message(row, key=key))

    def _bus_runs(self, run: EncodedRun) -> list[BusRun]:
        """The run as it is published: each class of events on its key. A schema no row has may be anything."""
        runs = []
        for number in np.unique(run.schema_of_row).tolist():
            kind = event_class(run.schemas[number])
            if kind is not None:
                key = observation_key(run.source, kind, root=self._settings.root)
                runs.append(BusRun(key, 1, of_schema(run, number)))
        return runs


def _is_heard(bus: Bus, key: str, heard: dict[str, bool]) -> bool:
    if key not in heard:
        heard[key] = bus.has_listener(key)
    return heard[key]


def of_schema(run: EncodedRun, number: int) -> EncodedRun:
    """The rows of a run in the schema of this number, as a run of that schema only."""
    own = (run.schema_of_row == number).nonzero()[0]
    picked = run.picked(own)
    return EncodedRun(
        source=picked.source,
        boot_id=picked.boot_id,
        schemas=(run.schemas[number],),
        schema_of_row=picked.schema_of_row * 0,
        sequences=picked.sequences,
        stamps_ns=picked.stamps_ns,
        payloads=picked.payloads,
    )


def rows_behind(rows: Sequence[Row], count: int) -> list[Row]:
    """The rows without the first `count` events."""
    left: list[Row] = []
    for row in rows:
        size = len(row) if isinstance(row, EncodedRun) else 1
        skipped = min(size, max(count, 0))
        count -= skipped
        if skipped == 0:
            left.append(row)
        elif isinstance(row, EncodedRun) and skipped < size:
            left.append(row.part(skipped, size))
    return left


def waits_for_disk(error: AppendFailed) -> bool:
    """Whether an append failed for want of room or by the medium: it may work later, and is worth trying again."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, OSError) and cause.errno in DISK_ERRORS:
            return True
        if getattr(cause, "sqlite_errorcode", 0) & SQLITE_PRIMARY in SQLITE_DISK_ERRORS:  # the catalog's
            return True
        cause = cause.__cause__
    return False
