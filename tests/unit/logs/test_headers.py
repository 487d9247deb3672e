"""Who said what when, without the payloads: the same as reading everything."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from event_examples.rows import fix_row, imu_row, imu_rows
from trigpoint.events.codec import Event, encode, schema_name
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.runs import EncodedRun
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.stream_writer import Rotation

Header = tuple[EventIdentity, str, int]
STREAM = "veh-van"


def told(runs: Sequence[EncodedRun]) -> list[Header]:
    return [
        (EventIdentity(run.source, run.boot_id, int(sequence)), run.schemas[schema], int(stamp_ns))
        for run in runs
        for schema, sequence, stamp_ns in zip(run.schema_of_row, run.sequences, run.stamps_ns, strict=True)
    ]


def headers(rows: Sequence[Envelope[Event]]) -> list[Header]:
    return [(row.identity, schema_name(type(row.event)), row.stamp_ns) for row in rows]


def written(folder: Path, rows: Sequence[Envelope[Event]], *, at_once: int) -> McapLog:
    log = McapLog(folder, rotation=Rotation(size_bytes=20_000))
    for first in range(0, len(rows), at_once):
        log.append(STREAM, rows[first : first + at_once])
    return log


def test_headers_of_a_log_of_several_files_are_those_of_its_events(tmp_path: Path) -> None:
    rows = [imu_row(sequence) if sequence % 7 else fix_row(sequence) for sequence in range(5000)]
    with_boots = [*rows, *(imu_row(sequence, boot_id="boot-2") for sequence in range(50)), imu_row(5000)]
    log = written(tmp_path, with_boots, at_once=400)
    assert len(log.contents(STREAM)) > 1
    assert told(list(log.read_headers(STREAM))) == headers(with_boots)
    log.close()


def test_sequences_beyond_32_bits_are_told_whole(tmp_path: Path) -> None:
    rows = [imu_row(2**32 - 2 + index) for index in range(4)]
    stamped = [replace(row, stamp_ns=1000 + index) for index, row in enumerate(rows)]
    log = written(tmp_path, stamped, at_once=4)
    assert told(list(log.read_headers(STREAM))) == headers(stamped)
    log.close()


def test_a_log_in_memory_tells_the_same() -> None:
    log = MemoryLog()
    log.append(STREAM, imu_rows(0, 20))
    assert told(list(log.read_headers(STREAM))) == headers(imu_rows(0, 20))


def test_runs_appended_are_read_as_the_events_they_hold(tmp_path: Path) -> None:
    first, second = written(tmp_path / "rows", imu_rows(0, 300), at_once=300), McapLog(tmp_path / "runs")
    second.append(STREAM, [as_run(imu_rows(0, 100)), *imu_rows(100, 200), as_run(imu_rows(200, 300))])
    assert [row.envelope for row in second.read(STREAM)] == [row.envelope for row in first.read(STREAM)]
    first.close()
    second.close()
    assert file_bytes(tmp_path / "runs") == file_bytes(tmp_path / "rows")


def as_run(rows: Sequence[Envelope[Event]]) -> EncodedRun:
    payloads = [encode(row.event)[1] for row in rows]
    return EncodedRun(
        source="van",
        boot_id="boot-1",
        schemas=(schema_name(type(rows[0].event)),),
        schema_of_row=np.zeros(len(rows), dtype=np.int64),
        sequences=np.array([row.identity.sequence for row in rows]),
        stamps_ns=np.array([row.stamp_ns for row in rows]),
        payloads=payloads,
    )


def file_bytes(folder: Path) -> list[bytes]:
    return [path.read_bytes() for path in sorted(folder.rglob("*.mcap"))]
