"""A vehicle's messages on disk until they are acknowledged: appended, fsynced in groups, read back in order, let go."""

import contextlib
import fcntl
import logging
import os
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from trigpoint.errors import AppendFailed, InputError, ServiceError
from trigpoint_vehicle.core.outgoing import Outgoing
from trigpoint_vehicle.core.spool_records import (
    HEAD_BYTES,
    MESSAGE,
    SEALED,
    SpoolChannel,
    channel_record,
    encode_record,
    segment_record,
    whole_records,
)
from trigpoint_vehicle.core.spool_walk import contents_of, sealed_contents, without_data
from trigpoint_vehicle.settings import VehicleSettings
from trigpoint_vehicle.spool_reading import SpoolReader, require_vehicle
from trigpoint_vehicle.spool_segments import (
    Segment,
    SegmentWriter,
    replace_segment,
    segment_path,
    segment_paths,
)

DROP_OLDEST = "drop oldest"
DAMAGED_SUFFIX = ".damaged"
LET_GO_SHARE = 4  # a segment that is a quarter full is closed once all of it is released
HEADS_BYTES = 512  # what goes with a payload at most: its record's head, its channel, its segment's beginning
UNKNOWN = -1  # the boot's next number, where a segment begins with a message of another
NS_PER_S = 1_000_000_000

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Behind:
    """What is spooled and not acknowledged: how many messages, their payloads' bytes, and the oldest one's age."""

    messages: int
    bytes: int
    oldest_s: float


class Spool:
    """One vehicle's spool in a folder of its own; one thread or several append, one reads, releases and syncs."""

    def __init__(
        self,
        folder: Path,
        vehicle: str,
        boot_id: str,
        settings: VehicleSettings,
        *,
        now_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._folder, self._vehicle, self._boot_id, self._settings = folder, vehicle, boot_id, settings
        self._now_ns = now_ns
        self._mutex = threading.Lock()
        self._segments: list[Segment] = []
        self._by_number: dict[int, Segment] = {}  # those begun to be read
        self._writer: SegmentWriter | None = None
        self._unsynced: list[SegmentWriter] = []
        self._channels: dict[SpoolChannel, int] = {}  # of the segment being written
        self._block: deque[Outgoing] = deque()  # read from a file and not yet asked for
        self._read: deque[Outgoing] = deque()  # handed out and not released
        self._waiting = self._waiting_bytes = self._disk_bytes = 0
        self._oldest_ns = 0
        self._number = 0
        self.dropped = 0
        self._lock_file = _locked(folder)
        try:
            self._find_segments()
        except BaseException:
            self._lock_file.close()
            raise
        self._reader = SpoolReader(self._following, root=settings.root)
        self._blocks = self._reader.messages()

    def _find_segments(self) -> None:
        for number, path in segment_paths(self._folder):
            self._number = number + 1
            try:
                self._find(number, path)
            except OSError as error:
                raise ServiceError(f"{path}: cannot be read: {error}") from error

    def _find(self, number: int, path: Path) -> None:
        with path.open("rb") as file:
            first = whole_records(file.read(HEADS_BYTES), 0, count=1)[0]
            size = file.seek(0, os.SEEK_END)
            file.seek(max(size - HEAD_BYTES, 0))
            found = sealed_contents(size, file.read())
        if first:
            require_vehicle(first[0], self._vehicle, path)
        if found is None:
            found = contents_of(path.read_bytes())
        if size and not found.whole_bytes:
            aside = path.rename(path.with_suffix(DAMAGED_SUFFIX))
            logger.error("%s: no whole record in %d bytes, kept aside", aside, size)
            return
        if found.whole_bytes < size:
            logger.warning("%s: cut behind its last whole record, at byte %d", path, found.whole_bytes)
            with path.open("r+b") as file:
                file.truncate(found.whole_bytes)
        segment = Segment(number, path, size=found.whole_bytes, durable=found.whole_bytes, sealed=True)
        self._segments.append(segment)
        self._disk_bytes += segment.size
        self._await(segment, messages=found.messages, payload_bytes=found.payload_bytes)
        self._oldest_ns = self._oldest_ns or (first[0].spooled_ns if first else 0)

    def append(self, channel: SpoolChannel, sequence: int, stamp_ns: int, payload: bytes) -> None:
        """The message is with the operating system; it is read back once it is durable.

        Raises AppendFailed if the spool or the disk is full, InputError for a value no record can hold.
        """
        now_ns = self._now_ns()
        with self._mutex:
            size = len(payload)
            writer = self._room_for(size + HEADS_BYTES, now_ns, sequence if channel.numbered else UNKNOWN)
            number = self._channels.get(channel, len(self._channels))
            data = encode_record(MESSAGE, number, sequence, stamp_ns, now_ns, payload)
            if channel not in self._channels:
                data = channel_record(number, channel) + data
            try:
                writer.append(data)
            except AppendFailed:
                self._end(writer)  # what is behind its end is never read, whatever was left there
                raise
            self._channels[channel] = number
            self._disk_bytes += len(data)
            if not self._waiting:
                self._oldest_ns = now_ns
            self._await(writer.segment, messages=1, payload_bytes=size)

    def _await(self, segment: Segment, *, messages: int, payload_bytes: int) -> None:
        segment.messages += messages
        segment.payload_bytes += payload_bytes
        self._waiting += messages
        self._waiting_bytes += payload_bytes

    def _room_for(self, size: int, now_ns: int, sequence: int) -> SegmentWriter:
        writer = self._writer
        if writer is not None and writer.segment.size + size > self._settings.segment_bytes:
            self._seal(writer)
            writer = None
        if self._disk_bytes + size > self._settings.spool_limit_bytes:
            self._make_room(size)
        if writer is None:
            writer = self._begin(now_ns, sequence)
        return writer

    def _begin(self, now_ns: int, sequence: int) -> SegmentWriter:
        segment = Segment(self._number, segment_path(self._folder, self._number))
        beginning = segment_record(self._vehicle, self._boot_id, next_sequence=sequence, spooled_ns=now_ns)
        writer = SegmentWriter(segment, beginning)
        self._number += 1
        self._writer = writer
        self._channels = {}
        self._segments.append(segment)
        self._unsynced.append(writer)
        self._disk_bytes += segment.size
        return writer

    def _seal(self, writer: SegmentWriter) -> None:
        segment = writer.segment
        seal = encode_record(SEALED, 0, segment.messages, segment.payload_bytes, self._now_ns())
        with contextlib.suppress(AppendFailed):  # without it, the segment is read through when it is found again
            writer.append(seal)
            self._disk_bytes += len(seal)
        self._end(writer)

    def _end(self, writer: SegmentWriter) -> None:
        writer.segment.sealed = True
        self._writer = None

    def _make_room(self, size: int) -> None:
        limit = self._settings.spool_limit_bytes
        while self._disk_bytes + size > limit:
            victim = self._victim() if self._settings.when_full == DROP_OLDEST else None
            if victim is None:
                raise AppendFailed(
                    f"{self._folder}: the spool of {self._vehicle!r} holds {self._disk_bytes} bytes, limit {limit}; "
                    f"{self._waiting} messages are not acknowledged"
                )
            self._drop(victim)

    def _victim(self) -> int | None:
        """The place of the oldest segment with data whose reading has not begun."""
        for place, segment in enumerate(self._segments):
            if segment.sealed and not segment.begun and not segment.emptied:
                return place
        return None

    def _drop(self, place: int) -> None:
        """The segment's data gone, and what stays of it in one file with what stays of those before."""
        segment = self._segments[place]
        before = self._segments[place - 1] if place else None
        parts = [before, segment] if before is not None and before.emptied and not before.begun else [segment]
        try:
            dropped = without_data([part.path.read_bytes() for part in parts])
            replace_segment(parts[0].path, dropped.data)
            for part in parts[1:]:
                part.path.unlink()
        except OSError as error:
            raise AppendFailed(f"{segment.path}: its data cannot be dropped: {error}") from error
        size = len(dropped.data)
        emptied = Segment(parts[0].number, parts[0].path, size=size, durable=size, sealed=True, emptied=True)
        self._segments[place - len(parts) + 1 : place + 1] = [emptied]
        self._disk_bytes += size - sum(part.size for part in parts)
        for part in parts:
            self._await(emptied, messages=part.messages, payload_bytes=part.payload_bytes)
            self._await(part, messages=-part.messages, payload_bytes=-part.payload_bytes)
        self._await(emptied, messages=-dropped.messages, payload_bytes=-dropped.payload_bytes)
        self.dropped += dropped.messages
        logger.error("spool of %s is full: the oldest %d messages dropped", self._vehicle, dropped.messages)

    def sync(self) -> None:
        """Everything appended before is durable, and may be read. Raises AppendFailed."""
        with self._mutex:
            due = [(writer, writer.segment.size, writer.segment.sealed) for writer in self._unsynced]
        for writer, size, is_sealed in due:
            if writer.segment.durable < size:
                writer.sync(size)
            if is_sealed:
                writer.close()
                with self._mutex:
                    self._unsynced.remove(writer)

    def read(self, *, count: int, size_bytes: int) -> list[Outgoing]:
        """The next durable messages, at most `count`, and as many until `size_bytes` are reached.

        Raises OSError for a file that cannot be read.
        """
        chosen: list[Outgoing] = []
        while len(chosen) < count and size_bytes > 0 and self._has_block():
            message = self._block.popleft()
            segment = self._by_number[message.segment]
            size_bytes -= len(message.payload)
            segment.waiting += 1
            segment.taken += message.is_data
            segment.taken_bytes += len(message.payload)
            chosen.append(message)
        with self._mutex:
            self._read.extend(chosen)
        return chosen

    def _has_block(self) -> bool:
        while not self._block:
            block = next(self._blocks)
            if block is None:
                return False
            self._block.extend(block)
        return True

    def _following(self, done: Segment | None) -> Segment | None:
        """The segment to be read next, None while there is none."""
        with self._mutex:
            if done is not None and not done.read:
                done.read = True
                damaged, damaged_bytes = done.messages - done.taken, done.payload_bytes - done.taken_bytes
                self._await(done, messages=-damaged, payload_bytes=-damaged_bytes)
                self._let_go(done)
            number = -1 if done is None else done.number
            following = next((segment for segment in self._segments if segment.number > number), None)
            if following is not None:
                following.begun = True
                self._by_number[following.number] = following
            return following

    def released(self, count: int) -> None:
        """The oldest `count` messages that were read are acknowledged; segments of which all are, are deleted."""
        with self._mutex:
            for _ in range(count):
                message = self._read.popleft()
                segment = self._by_number[message.segment]
                self._oldest_ns = message.spooled_ns or self._oldest_ns
                self._waiting -= message.is_data
                self._waiting_bytes -= len(message.payload)
                segment.waiting -= 1
                if segment.read and not segment.waiting:
                    self._let_go(segment)
            if self._writer is not None and not self._waiting and not self._read:
                self._seal_grown(self._writer)

    def _seal_grown(self, writer: SegmentWriter) -> None:
        if writer.segment.size * LET_GO_SHARE > self._settings.segment_bytes:
            self._seal(writer)

    def _let_go(self, segment: Segment) -> None:
        if segment.waiting:
            return
        with contextlib.suppress(ValueError):  # let go before
            self._segments.remove(segment)
            self._by_number.pop(segment.number, None)
            self._disk_bytes -= segment.size
            segment.path.unlink(missing_ok=True)

    @property
    def behind(self) -> Behind:
        """What waits for its acknowledgement."""
        with self._mutex:
            if not self._waiting:
                return Behind(messages=0, bytes=0, oldest_s=0.0)
            oldest_ns = (self._read[0].spooled_ns if self._read else 0) or self._oldest_ns
            age_s = max(self._now_ns() - oldest_ns, 0) / NS_PER_S
            return Behind(messages=self._waiting, bytes=self._waiting_bytes, oldest_s=age_s)

    @property
    def disk_bytes(self) -> int:
        """The bytes of all segments."""
        return self._disk_bytes

    @property
    def damaged_bytes(self) -> int:
        """The bytes found damaged while reading."""
        return self._reader.damaged_bytes

    @property
    def is_drained(self) -> bool:
        """Whether nothing waits to be sent or acknowledged."""
        with self._mutex:
            return not self._waiting and not self._read and not any(segment.emptied for segment in self._segments)

    def close(self) -> None:
        """Everything appended is durable; nothing is held open; what is all acknowledged is deleted."""
        with self._mutex:
            if self._writer is not None:
                self._seal(self._writer)
        try:
            self.sync()
        finally:
            self._blocks.close()
            self._delete_acknowledged()
            self._lock_file.close()

    def _delete_acknowledged(self) -> None:
        if self.is_drained:
            with self._mutex:
                for segment in list(self._segments):
                    self._let_go(segment)


def _locked(folder: Path) -> TextIO:
    """The lock on a spool's folder, which the operating system drops with its holder. Raises InputError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = (folder / "lock").open("a", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{folder}: cannot be a spool: {error}") from error
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        handle.close()
        raise InputError(f"{folder}: another publisher has this spool: one folder, one publisher") from error
    return handle
