import io
import weakref
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from event_examples.one_each import EVENTS, ONE_OF_EACH
from event_examples.rows import START_NS, imu_row, imu_rows
from trigpoint.errors import AppendFailed, InputError, LogDamaged
from trigpoint.events.codec import decode
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import Observed
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.mcap_scan import Damage
from trigpoint.logs.vehicle_log import (
    BATCH_SWEEPS,
    RawMessage,
    read_vehicle_log,
    read_whole_messages,
    write_vehicle_log,
)

CHUNK_HEAD_BYTES = 9 + 8 + 8 + 8 + 4 + 4 + len("zstd") + 8  # of a chunk record, before its data
ROWS = imu_rows(0, 10_000)  # three chunks


@pytest.fixture
def path(tmp_path: Path) -> Path:
    written = tmp_path / "van.mcap"
    write_vehicle_log(written, ROWS, vehicle="van")  # type: ignore[arg-type]
    return written


def _chunk_offsets(path: Path) -> list[int]:
    content = path.read_bytes()
    records = StreamReader(io.BytesIO(content), emit_chunks=True).records
    return [content.find(record.data) for record in records if isinstance(record, Chunk)]


def _flip(path: Path, offset: int) -> None:
    content = bytearray(path.read_bytes())
    content[offset] ^= 1
    path.write_bytes(content)


def _read(path: Path) -> tuple[list[RawMessage], list[Damage]]:
    damages: list[Damage] = []
    return list(read_whole_messages(path, damages)), damages


def test_every_row_comes_back_as_it_was(path: Path) -> None:
    found = list(read_vehicle_log(path))
    assert [(row.identity, row.stamp_ns) for row in found] == [(row.identity, row.stamp_ns) for row in ROWS]
    assert decode(found[7].schema_name, found[7].payload) == ROWS[7].event


def test_the_number_of_rows_is_returned(tmp_path: Path) -> None:
    assert write_vehicle_log(tmp_path / "a.mcap", ROWS[:5], vehicle="van") == 5  # type: ignore[arg-type]


def test_the_same_rows_make_the_same_bytes(path: Path, tmp_path: Path) -> None:
    write_vehicle_log(tmp_path / "again.mcap", iter(ROWS), vehicle="van")  # type: ignore[arg-type]
    assert (tmp_path / "again.mcap").read_bytes() == path.read_bytes()


def test_a_log_of_no_rows_is_whole_and_empty(tmp_path: Path) -> None:
    write_vehicle_log(tmp_path / "none.mcap", [], vehicle="van")
    assert list(read_vehicle_log(tmp_path / "none.mcap")) == []


def test_a_failed_write_leaves_no_file(tmp_path: Path) -> None:
    bad = Envelope(EventIdentity("van", "b", 0), -5, ROWS[0].event)
    with pytest.raises(InputError, match="-5"):
        write_vehicle_log(tmp_path / "bad.mcap", [bad], vehicle="van")  # type: ignore[list-item]
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_not_there_fails_the_write(tmp_path: Path) -> None:
    with pytest.raises(AppendFailed, match="nowhere"):
        write_vehicle_log(tmp_path / "nowhere" / "van.mcap", [], vehicle="van")


def test_a_folder_that_is_a_file_fails_the_write(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(AppendFailed, match="Not a directory"):
        write_vehicle_log(tmp_path / "file" / "van.mcap", [], vehicle="van")


def test_an_empty_file_is_damaged(tmp_path: Path) -> None:
    (tmp_path / "empty.mcap").touch()
    with pytest.raises(LogDamaged, match=r"empty\.mcap, byte 0: file of 0 bytes"):
        list(read_vehicle_log(tmp_path / "empty.mcap"))


def test_a_file_of_something_else_is_damaged(tmp_path: Path) -> None:
    (tmp_path / "text.mcap").write_text("time,speed\n" * 100)
    with pytest.raises(LogDamaged, match="expected .*MCAP"):
        list(read_vehicle_log(tmp_path / "text.mcap"))


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(LogDamaged, match="gone.mcap"):
        list(read_vehicle_log(tmp_path / "gone.mcap"))


def test_a_flipped_bit_loses_its_chunk_only_and_the_loss_is_counted(path: Path) -> None:
    second = _chunk_offsets(path)[1]
    _flip(path, second + 1000)
    found, (damage,) = _read(path)
    assert damage.lost_messages == len(ROWS) - len(found) == 4096
    assert {row.identity.sequence for row in found} == {*range(4096), *range(8192, 10_000)}


def test_damage_is_raised_after_everything_whole(path: Path) -> None:
    _flip(path, _chunk_offsets(path)[0] + 1000)
    reading = read_vehicle_log(path)
    assert len(list(islice(reading, len(ROWS) - 4096))) == len(ROWS) - 4096
    with pytest.raises(LogDamaged, match=r"van\.mcap, byte \d+: .*4096 messages lost"):
        next(reading)


def test_the_channels_of_a_lost_first_chunk_come_from_the_summary(path: Path) -> None:
    _flip(path, _chunk_offsets(path)[0] + 1000)
    found, _ = _read(path)
    assert {row.topic for row in found} == {"veh/van/obs/imu"}


def test_a_truncated_file_gives_its_whole_chunks(path: Path) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: _chunk_offsets(path)[2] + 50])
    found, damages = _read(path)
    assert len(found) == 8192
    assert "reaches past the end" in damages[0].reason


def test_a_nonsensical_length_is_skipped_to_the_next_chunk(path: Path) -> None:
    content = bytearray(path.read_bytes())
    length_at = _chunk_offsets(path)[1] - CHUNK_HEAD_BYTES + 1
    content[length_at : length_at + 8] = b"\xff" * 8
    path.write_bytes(content)
    found, damages = _read(path)
    assert {row.identity.sequence for row in found} == {*range(4096), *range(8192, 10_000)}
    assert "reaches past the end" in damages[0].reason


def test_messages_of_another_writer_are_read_too(tmp_path: Path) -> None:
    foreign = tmp_path / "foreign.mcap"
    with foreign.open("wb") as file:
        writer = Writer(file, compression=CompressionType.LZ4)
        writer.start()
        schema = writer.register_schema("foreign.Thing", "protobuf", b"")
        channel = writer.register_channel("/thing", "protobuf", schema)
        writer.add_message(channel, START_NS, b"abc", START_NS, 4)
        writer.finish()  # type: ignore[no-untyped-call]
    assert list(read_vehicle_log(foreign)) == [
        RawMessage("/thing", "foreign.Thing", b"abc", EventIdentity("", "", 4), START_NS)
    ]


def _foreign_log(path: Path, metadata: dict[str, str]) -> bytes:
    """A file of one message by a writer that leaves the summary's checksum out."""
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=False, enable_crcs=False)
        writer.start()
        channel = writer.register_channel("/thing", "protobuf", 0, metadata)
        writer.add_message(channel, START_NS, b"abc", START_NS, 4)
        writer.finish()  # type: ignore[no-untyped-call]
    return path.read_bytes()


@pytest.mark.parametrize("summary_start", [3, 2**40, 2**64 - 1])
def test_a_summary_outside_of_its_file_costs_no_message(tmp_path: Path, summary_start: int) -> None:
    content = _foreign_log(tmp_path / "foreign.mcap", {})
    footer_end = len(content) - 8 - 8 - 4  # magic, offsets' start and checksum behind the summary's start
    (tmp_path / "foreign.mcap").write_bytes(
        content[: footer_end - 8] + summary_start.to_bytes(8, "little") + content[footer_end:]
    )
    found, (damage,) = _read(tmp_path / "foreign.mcap")
    assert (len(found), damage.lost_messages) == (1, 0)
    assert f"summary starts at {summary_start}" in damage.reason


def test_a_summary_that_cannot_be_read_is_named_and_not_raised(tmp_path: Path) -> None:
    _foreign_log(tmp_path / "foreign.mcap", {"sequence_base": "soon"})
    _, damages = _read(tmp_path / "foreign.mcap")
    assert any("summary" in damage.reason and "sequence base" in damage.reason for damage in damages)


def test_messages_outside_of_chunks_are_read_too(tmp_path: Path) -> None:
    foreign = tmp_path / "foreign.mcap"
    with foreign.open("wb") as file:
        writer = Writer(file, use_chunking=False)
        writer.start()
        channel = writer.register_channel("/thing", "protobuf", 0, {"source": "van", "boot_id": "b"})
        writer.add_message(channel, START_NS, b"abc", START_NS, 4)
        writer.finish()  # type: ignore[no-untyped-call]
    assert [row.identity for row in read_vehicle_log(foreign)] == [EventIdentity("van", "b", 4)]


def test_one_of_each_class_comes_back(tmp_path: Path) -> None:
    write_vehicle_log(tmp_path / "all.mcap", ONE_OF_EACH, vehicle="van")  # type: ignore[arg-type]
    found = list(read_vehicle_log(tmp_path / "all.mcap"))
    assert [row.identity for row in found] == [row.identity for row in ONE_OF_EACH]


def test_rows_of_a_vehicle_whose_boot_starts_anew_are_told_apart(tmp_path: Path) -> None:
    rows = [imu_row(0, boot_id="one"), imu_row(0, boot_id="two")]
    write_vehicle_log(tmp_path / "boots.mcap", rows, vehicle="van")  # type: ignore[arg-type]
    assert [row.identity.boot_id for row in read_vehicle_log(tmp_path / "boots.mcap")] == ["one", "two"]


def test_sweeps_are_written_before_many_of_them_are_in_memory(tmp_path: Path) -> None:
    sweep = next(event for event in EVENTS if isinstance(event, PointsScanned))
    alive: list[int] = []
    made: list[weakref.ref[np.ndarray[Any, Any]]] = []

    def rows() -> Iterator[Envelope[Observed]]:
        for number in range(5 * BATCH_SWEEPS):
            one = replace(sweep, ring=sweep.ring.copy())
            made.append(weakref.ref(one.ring))
            alive.append(sum(kept() is not None for kept in made))
            yield Envelope(EventIdentity("van", "boot-1", number), START_NS + number, one)

    write_vehicle_log(tmp_path / "van.mcap", rows(), vehicle="van")
    assert max(alive) <= 2 * BATCH_SWEEPS
