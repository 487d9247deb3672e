"""Groups of events made durable, then published, then acknowledged: always in this order."""

import errno
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from trigpoint.bus.event_messages import event_message
from trigpoint.bus.ports import Bus, BusMessage, BusRun
from trigpoint.errors import AppendFailed, TrigpointError
from trigpoint.events.codec import Event, event_class
from trigpoint.events.envelope import Envelope
from trigpoint.events.keys import key_of
from trigpoint.events.runs import EncodedRun
from trigpoint.events.uplink import observation_key
from trigpoint.logs.ports import RecallingLog
from trigpoint.observability.metrics import Instruments
from trigpoint_ingest.settings import IngestSettings

DISK_ERRORS = frozenset((errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EROFS))  # room and media: an operator mends them
SQLITE_DISK_ERRORS = frozenset((8, 10, 13))  # SQLITE_READONLY, SQLITE_IOERR, SQLITE_FULL (sqlite.org/rescode.html)
SQLITE_PRIMARY = 0xFF  # bits of the primary code in an extended one

Row = Envelope[Event] | EncodedRun


@dataclass(slots=True)
class Group:
    """What becomes durable together: rows by stream, and what their vehicles are told then."""

    to_append: dict[str, list[Row]]
    acknowledgements: list[BusMessage]
    appended: list[list[Row]] = field(default_factory=list)


class GroupCommit:
    """Commits groups, one after the other."""

    def __init__(self, log: RecallingLog, bus: Bus | None, settings: IngestSettings, instruments: Instruments) -> None:
        self._log, self._bus = log, bus
        self._settings, self._instruments = settings, instruments
        self._following: dict[str, int] = {}  # by stream, the number the first row of its next group gets
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

    def _append_all(self, group: Group) -> None:
        """Every stream's rows appended, side by side. Raises AppendFailed; of several what cannot be waited for."""
        left, failures = self._left(group.to_append)
        together = self._log.append_all({stream: rows for stream, rows in left.items() if rows})
        self._let_go |= together.failures.keys()
        for stream in sorted(left.keys() - together.failures.keys()):
            rows = group.to_append.pop(stream)
            self._following[stream] += sum(map(_count, rows))
            self._let_go.discard(stream)
            group.appended.append(rows)
        raised = sorted([*failures, *together.failures.values()], key=_may_wait)
        if raised:
            raise raised[0]

    def _left(self, to_append: Mapping[str, list[Row]]) -> tuple[dict[str, list[Row]], list[TrigpointError]]:
        """The rows without those that an append which failed had made durable nevertheless, as far as that can be
        found out, and why it cannot."""
        left: dict[str, list[Row]] = {}
        failures: list[TrigpointError] = []
        for stream, rows in to_append.items():
            try:
                left[stream] = rows_behind(rows, self._durable_count(stream)) if self._is_unsure(stream) else rows
            except TrigpointError as error:
                failures.append(error)
        return left, failures

    def _is_unsure(self, stream: str) -> bool:
        return stream in self._let_go or stream not in self._following

    def _durable_count(self, stream: str) -> int:
        """How many of a stream's rows are durable, though their append failed."""
        there = self._log.append(stream, ()).number + 1
        return there - self._following.setdefault(stream, there)

    def _publish(self, bus: Bus, rows: Sequence[Row]) -> None:
        """The rows on their keys; where nobody listens to a key, nothing is sent: the log has it."""
        heard: dict[str, bool] = {}
        for row in rows:
            if isinstance(row, EncodedRun):
                for run in self._bus_runs(row, lambda key: _is_heard(bus, key, heard)):
                    bus.publish_run(run)
            else:
                key = key_of(row, root=self._settings.root, map_name=self._settings.map_name)
                if _is_heard(bus, key, heard):
                    bus.publish(event_message(row, key=key))

    def _bus_runs(self, run: EncodedRun, is_heard: Callable[[str], bool]) -> Iterator[BusRun]:
        """The run as it is published: each class of events on its key, where somebody listens to that. A schema no
        row has may be anything."""
        for number, schema in enumerate(run.schemas):
            kind = event_class(schema) if (run.schema_of_row == number).any() else None
            key = "" if kind is None else observation_key(run.source, kind, root=self._settings.root)
            if key and is_heard(key):
                yield BusRun(key, 1, of_schema(run, number))


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


def _count(row: Row) -> int:
    return len(row) if isinstance(row, EncodedRun) else 1


def rows_behind(rows: Sequence[Row], count: int) -> list[Row]:
    """The rows without the first `count` events."""
    left: list[Row] = []
    for row in rows:
        size = _count(row)
        skipped = min(size, max(count, 0))
        count -= skipped
        if skipped == 0:
            left.append(row)
        elif isinstance(row, EncodedRun) and skipped < size:
            left.append(row.part(skipped, size))
    return left


def _may_wait(error: TrigpointError) -> bool:
    return isinstance(error, AppendFailed) and waits_for_disk(error)


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
