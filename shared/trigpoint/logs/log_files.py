"""The files of one stream: their names, what they hold, and what a crash left of the last one mended."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from mcap.records import Chunk

from trigpoint.errors import InputError, LogDamaged
from trigpoint.logs.catalog import Catalog, CatalogChunk, CatalogEntry, CatalogFile
from trigpoint.logs.chunks import FRAME, PackedChunk, message_indexes, messages, parsed
from trigpoint.logs.file_bytes import FileBytes
from trigpoint.logs.mcap_scan import McapScan
from trigpoint.logs.mcap_writer import FileIndex

LOCK_NAME = ".lock"  # in a stream's folder, held by its writer
NUMBER_DIGITS = 12
SUFFIX = ".mcap"
NAME_LIMIT_BYTES = 255  # of a folder's name, in UTF-8, on all usual file systems


def valid_stream(stream: str) -> str:
    """The name itself, if a folder can have it. Raises InputError."""
    size_bytes = len(stream.encode("utf-8", "surrogatepass"))
    if not 0 < size_bytes <= NAME_LIMIT_BYTES or not stream.isprintable():
        raise InputError(f"stream {stream!r} has {size_bytes} bytes: 1 to {NAME_LIMIT_BYTES} that print are allowed")
    if stream.startswith(".") or "/" in stream:
        raise InputError(f"stream {stream!r} starts with a dot or holds a slash")
    return stream


def file_path(folder: Path, first_number: int) -> Path:
    """Where the file whose first event has this number stands."""
    return folder / f"{first_number:0{NUMBER_DIGITS}d}{SUFFIX}"


def file_numbers(folder: Path) -> tuple[int, ...]:
    """The first numbers of a stream's files, ascending; nothing for a stream without folder."""
    return tuple(sorted(int(path.stem) for path in folder.glob("[0-9]" * NUMBER_DIGITS + SUFFIX)))


def entry_of(folder: Path, stream: str, first_number: int) -> CatalogEntry:
    """What a file holds, read from itself: every whole chunk before the first one lost; all of it durable."""
    scan = McapScan(file_path(folder, first_number))
    _make_durable(scan.path)
    size_bytes = scan.path.stat().st_size
    chunks = tuple(_catalog_chunks(scan, first_number))
    file = CatalogFile(stream, first_number, size_bytes, scan.complete, str(scan.loss) if scan.loss else "")
    return CatalogEntry(file, chunks, tuple(sorted(scan.channels.items())))


def _make_durable(path: Path) -> None:
    """What a killed writer left in the system's memory is on the disk, before anyone is told of it."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


def _catalog_chunks(scan: McapScan, first_number: int) -> Iterator[CatalogChunk]:
    number = first_number
    for chunk in scan.chunks():
        if any(damage.lost_messages for damage in scan.damages):
            continue  # what follows a loss has no certain number
        channels = [message.channel_id for message in messages(chunk.data)]
        place = (chunk.start_ns, chunk.end_ns, chunk.offset, chunk.length)
        yield CatalogChunk(first_number, number, len(channels), *place, tuple(sorted(set(channels))))
        number += len(channels)


def bring_up_to_date(catalog: Catalog, folder: Path, stream: str, *, alone: bool = False) -> None:
    """The catalog says of a stream what its files say: those whose size it does not know are read.

    A file that lost chunks the catalog knows stays as it was there: reading it names what is gone. Where another
    process writes the stream, the files it entered are left to it: what it has not entered is not durable yet;
    `alone`: there is no other, the caller holds the stream's lock.
    """
    known = {file.first_number: file for file in catalog.files(stream)}
    there = file_numbers(folder)
    grown = [number for number in there if number not in known or known[number].size_bytes != _size(folder, number)]
    if grown and not alone and has_writer(folder):
        grown = [number for number in grown if number not in known]
    for first_number in grown:
        with suppress(FileNotFoundError):  # retained away meanwhile
            catalog.replace(entry_of(folder, stream, first_number))
    for gone in known.keys() - set(there):
        catalog.remove(known[gone])


def _size(folder: Path, first_number: int) -> int:
    """In bytes; -1 for a file that is gone."""
    try:
        return file_path(folder, first_number).stat().st_size
    except FileNotFoundError:
        return -1


def has_writer(folder: Path) -> bool:
    """Whether a process has the stream open for appending."""
    try:
        lock = (folder / LOCK_NAME).open("rb")
    except FileNotFoundError:
        return False
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        return False


def lost_chunks(catalog: Catalog, entry: CatalogEntry) -> tuple[CatalogChunk, ...]:
    """Chunks of a file that the catalog knows, so that they were durable once, and the file has no more."""
    first_number = entry.file.first_number
    return catalog.file_chunks(entry.file.stream, first_number)[len(entry.chunks) :]


def mend(catalog: Catalog, folder: Path, stream: str) -> None:
    """Every file of a stream ended with its summary; one a crash left open is cut after its last whole chunk.

    Raises LogDamaged where events that were acknowledged, or more than a torn tail, would be lost by that.
    """
    for file in catalog.files(stream):
        if not file.finished:
            _mend_file(catalog, folder, file)


def _mend_file(catalog: Catalog, folder: Path, file: CatalogFile) -> None:
    path = file_path(folder, file.first_number)
    entry = entry_of(folder, file.stream, file.first_number)
    if entry.file.damage:
        raise LogDamaged(f"{entry.file.damage}: not mended, since more than its tail is damaged")
    for lost in lost_chunks(catalog, entry)[:1]:
        raise LogDamaged(f"{path}, byte {lost.offset}: events from number {lost.number} on were durable and are gone")
    if not entry.chunks:
        path.unlink()
        catalog.remove(file)
        return
    end_whole(path)
    catalog.replace(entry_of(folder, file.stream, file.first_number))


def end_whole(path: Path) -> None:
    """The file cut after its last whole chunk and ended with its summary; opened again, it is without damage.

    Raises LogDamaged if it is not, OSError if it cannot be written.
    """
    scan = McapScan(path)
    index = FileIndex()
    with FileBytes(path) as content:
        tail, end = b"", 0
        for chunk in scan.chunks():
            end = chunk.offset + chunk.length
            record = parsed(Chunk, content.read(chunk.offset + FRAME.size, end))
            packed = PackedChunk(record, message_indexes(chunk.data))
            length, data = index.add_chunk(packed, chunk.offset)
            tail = data[length:]
        index.schemas, index.channels, index.metadata = scan.schemas, scan.channel_records, scan.metadata_indexes
        _rewrite_end(path, end, tail, index)
    again = McapScan(path)
    count = sum(1 for _ in again.chunks())
    if again.damages or count != index.chunk_count:
        raise LogDamaged(f"{path}: still damaged after its end was written anew: {again.damages}")


def _rewrite_end(path: Path, end: int, tail: bytes, index: FileIndex) -> None:
    with path.open("r+b", buffering=0) as file:
        os.ftruncate(file.fileno(), end)
        _write_at(file.fileno(), tail, end)
        with FileBytes(path) as content:
            checksum = content.checksum(0, content.size_bytes)
        ending = index.ending(offset=end + len(tail), data_crc=checksum)
        _write_at(file.fileno(), ending, end + len(tail))
        os.fsync(file.fileno())


def _write_at(descriptor: int, data: bytes, offset: int) -> None:
    """All of the data written: where a disk fills up, it first takes less than it is given. Raises OSError."""
    remaining = memoryview(data)
    while remaining:
        written = os.pwrite(descriptor, remaining, offset)
        remaining, offset = remaining[written:], offset + written
