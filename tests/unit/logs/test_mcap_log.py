import os
import resource
import shutil
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message_factory import GetMessages
from mcap.reader import make_reader

from event_examples.one_each import ONE_OF_EACH
from event_examples.rows import START_NS, STEP_NS, fix_row, imu_row, imu_rows
from trigpoint.errors import AppendFailed, InputError, LogDamaged
from trigpoint.events.envelope import Envelope, EventIdentity, LogPosition
from trigpoint.events.estimated import FixJudged
from trigpoint.events.observed import GnssFixReceived, MapFramePinned
from trigpoint.logs.log_files import entry_of
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.stream_writer import Rotation

STREAM = "veh-van"


@pytest.fixture
def log(tmp_path: Path) -> Iterator[McapLog]:
    opened = McapLog(tmp_path / "log")
    yield opened
    opened.close()


def _only_file(log: McapLog) -> Path:
    (path,) = (log.directory / STREAM).glob("*.mcap")
    return path


def _sequences(log: McapLog) -> list[int]:
    return [logged.envelope.identity.sequence for logged in log.read(STREAM)]


@pytest.fixture
def small_files(tmp_path: Path) -> Iterator[McapLog]:
    """Ten files of ten events each, in ten chunks of one."""
    opened = McapLog(tmp_path / "small", rotation=Rotation(span_ns=9 * STEP_NS, span_least_bytes=0))
    for row in imu_rows(0, 100):
        opened.append(STREAM, [row])
    yield opened
    opened.close()


def test_files_are_named_by_their_first_number(small_files: McapLog) -> None:
    names = sorted(path.name for path in (small_files.directory / STREAM).glob("*.mcap"))
    assert names == [f"{number:012d}.mcap" for number in range(0, 100, 10)]


def test_a_file_that_is_long_enough_is_followed_by_another(tmp_path: Path) -> None:
    log = McapLog(tmp_path, rotation=Rotation(size_bytes=1))
    log.append(STREAM, imu_rows(0, 3))
    log.append(STREAM, imu_rows(3, 5))
    log.close()
    assert [contents.count for contents in McapLog(tmp_path).contents(STREAM)] == [3, 2]


def test_a_time_query_opens_only_the_file_and_the_chunks_it_needs(small_files: McapLog) -> None:
    found = list(small_files.read(STREAM, from_ns=START_NS + 42 * STEP_NS, until_ns=START_NS + 45 * STEP_NS))
    assert len(found) == 3
    assert (small_files.read_counts.files, small_files.read_counts.chunks) == (1, 3)


def test_reading_from_a_number_opens_no_earlier_file(small_files: McapLog) -> None:
    assert len(list(small_files.read(STREAM, first_number=88))) == 12
    assert (small_files.read_counts.files, small_files.read_counts.chunks) == (2, 12)


def test_chunks_without_the_kind_asked_for_stay_closed(log: McapLog) -> None:
    log.append(STREAM, imu_rows(0, 5))
    log.append(STREAM, [fix_row(5)])
    assert len(list(log.read(STREAM, kinds=[GnssFixReceived]))) == 1
    assert log.read_counts.chunks == 1


def test_the_catalog_tells_a_files_vehicles_topics_and_times(log: McapLog) -> None:
    log.append(STREAM, [imu_row(0), fix_row(1)])
    (contents,) = log.contents(STREAM)
    assert (contents.vehicles, contents.topics) == (("van",), ("veh/van/obs/gnss", "veh/van/obs/imu"))
    assert (contents.start_ns, contents.end_ns, contents.count) == (START_NS, START_NS + STEP_NS, 2)


def test_a_lost_catalog_is_rebuilt_from_the_files(small_files: McapLog) -> None:
    small_files.close()
    (small_files.directory / "catalog.sqlite").unlink()
    again = McapLog(small_files.directory)
    assert (again.next_number(STREAM), _sequences(again)) == (100, list(range(100)))
    again.close()


def test_a_catalog_that_is_no_database_is_rebuilt_from_the_files(small_files: McapLog) -> None:
    small_files.close()
    (small_files.directory / "catalog.sqlite").write_bytes(b"rubbish" * 1000)
    again = McapLog(small_files.directory)
    assert again.next_number(STREAM) == 100
    again.close()


def test_a_rebuilt_catalog_equals_the_one_kept_while_writing(small_files: McapLog) -> None:
    small_files.close()
    before = McapLog(small_files.directory)
    kept = before.contents(STREAM)
    before.close()
    (small_files.directory / "catalog.sqlite").unlink()
    after = McapLog(small_files.directory)
    assert after.contents(STREAM) == kept
    after.close()


def test_a_second_writer_of_a_stream_is_told_who_has_it(log: McapLog) -> None:
    log.append(STREAM, imu_rows(0, 1))
    other = McapLog(log.directory)
    with pytest.raises(AppendFailed, match=r"stream veh-van has a writer already, process \d+"):
        other.append(STREAM, imu_rows(1, 2))
    other.close()


def test_two_logs_may_write_different_streams(log: McapLog) -> None:
    log.append(STREAM, imu_rows(0, 1))
    other = McapLog(log.directory)
    assert other.append("veh-car", imu_rows(0, 1)) == LogPosition("veh-car", 0)
    other.close()


def test_a_reader_sees_what_another_log_appends(log: McapLog) -> None:
    reader = McapLog(log.directory)
    log.append(STREAM, imu_rows(0, 3))
    assert _sequences(reader) == [0, 1, 2]
    log.append(STREAM, imu_rows(3, 4))
    assert reader.next_number(STREAM) == 4
    reader.close()


def test_a_slow_reader_takes_nothing_out_of_the_catalog(log: McapLog) -> None:
    log.append(STREAM, imu_rows(0, 5))
    read_before = entry_of(log.directory / STREAM, STREAM, 0)
    log.append(STREAM, imu_rows(5, 10))
    log._catalog.replace(read_before)
    assert _sequences(log) == list(range(10))


def test_a_closed_stream_can_be_written_by_another(log: McapLog) -> None:
    first = McapLog(log.directory)
    first.append(STREAM, imu_rows(0, 2))
    first.close()
    assert log.append(STREAM, imu_rows(2, 3)) == LogPosition(STREAM, 2)


def test_the_same_events_make_the_same_bytes(tmp_path: Path) -> None:
    logs = [McapLog(tmp_path / name) for name in ("one", "two")]
    for log in logs:
        log.append(STREAM, ONE_OF_EACH)
        log.append(STREAM, imu_rows(0, 100))
        log.close()
    assert _only_file(logs[0]).read_bytes() == _only_file(logs[1]).read_bytes()


def test_a_finished_file_passes_the_mcap_reader_with_checksums(log: McapLog) -> None:
    log.append(STREAM, ONE_OF_EACH)
    log.close()
    with _only_file(log).open("rb") as file:
        found = list(make_reader(file, validate_crcs=True).iter_messages(log_time_order=False))
    assert [message.sequence for _, _, message in found] == [row.identity.sequence for row in ONE_OF_EACH]


def test_a_file_tells_a_stranger_how_to_decode_its_messages(log: McapLog) -> None:
    log.append(STREAM, [fix_row(7)])
    log.close()
    with _only_file(log).open("rb") as file:
        ((schema, _, message),) = make_reader(file).iter_messages()
    assert schema is not None
    decoded = GetMessages(FileDescriptorSet.FromString(schema.data).file)[schema.name].FromString(message.data)
    assert (decoded.latitude, decoded.longitude) == (-33.89, 151.19)  # type: ignore[attr-defined]  # made at run time


def test_the_mcap_reader_finds_a_time_range_through_the_index(log: McapLog) -> None:
    log.append(STREAM, imu_rows(0, 50))
    log.close()
    with _only_file(log).open("rb") as file:
        found = make_reader(file).iter_messages(
            starting_at=START_NS + 10 * STEP_NS, ending_before=START_NS + 13 * STEP_NS
        )
        assert [message.sequence for _, _, message in found] == [10, 11, 12]


def test_identity_and_topic_are_in_the_channel(log: McapLog) -> None:
    log.append(STREAM, [fix_row(7)])
    log.close()
    with _only_file(log).open("rb") as file:
        ((schema, channel, message),) = make_reader(file).iter_messages()
    assert schema is not None
    assert (schema.name, channel.topic, message.sequence) == ("foxglove.LocationFix", "veh/van/obs/gnss", 7)
    assert channel.metadata == {"source": "van", "boot_id": "boot-1", "vehicle": "van"}


def test_metadata_name_software_map_frame_and_vehicle(tmp_path: Path) -> None:
    log = McapLog(tmp_path, software="trigpoint 0.1.0", map_name="campus")
    log.describe(MapFramePinned(crs="EPSG:32756", origin_easting_m=3e5, origin_northing_m=6e6, declared_by="van"))
    log.append(STREAM, imu_rows(0, 1))
    log.close()
    with _only_file(log).open("rb") as file:
        metadata = {record.name: record.metadata for record in make_reader(file).iter_metadata()}
    assert metadata["software"] == {"name": "trigpoint 0.1.0"}
    assert metadata["vehicle"] == {"name": "van"}
    origin = {"origin_easting_m": "300000.0", "origin_northing_m": "6000000.0"}
    assert metadata["map"] == {"name": "campus", "crs": "EPSG:32756", **origin}


def test_a_flipped_bit_stops_reading_at_its_chunk_and_is_named(log: McapLog) -> None:
    log.append(STREAM, imu_rows(0, 5))
    log.append(STREAM, imu_rows(5, 10))
    path, (_, second) = _only_file(log), log._catalog.chunks(STREAM)
    _flip(path, second.offset + second.length // 2)
    reading = log.read(STREAM)
    assert [next(reading).position.number for _ in range(5)] == [0, 1, 2, 3, 4]
    with pytest.raises(LogDamaged, match=rf"{path}, byte {second.offset}: .* 5 messages lost"):
        next(reading)


def _flip(path: Path, offset: int) -> None:
    content = bytearray(path.read_bytes())
    content[offset] ^= 1
    path.write_bytes(content)


@contextmanager
def _largest_file(size_bytes: int) -> Iterator[None]:
    """The kernel refuses to let any file of this process grow beyond, as it would on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_fails_the_append_and_names_the_number(log: McapLog) -> None:
    log.append(STREAM, imu_rows(0, 10))
    with _largest_file(200_000), pytest.raises(AppendFailed, match="stream veh-van, number 10: .*File too large"):
        log.append(STREAM, imu_rows(10, 30_000))


def test_after_a_full_disk_all_that_was_acknowledged_is_there_and_writing_goes_on(log: McapLog) -> None:
    log.append(STREAM, imu_rows(0, 10))
    with _largest_file(200_000), pytest.raises(AppendFailed):
        log.append(STREAM, imu_rows(10, 30_000))
    assert _sequences(log) == list(range(10))
    assert log.append(STREAM, imu_rows(10, 12)) == LogPosition(STREAM, 11)
    assert _sequences(log) == list(range(12))


def test_a_lock_that_cannot_be_written_fails_the_append_and_is_let_go(log: McapLog) -> None:
    with _largest_file(0), pytest.raises(AppendFailed, match="stream veh-van: not locked: .*File too large"):
        log.append(STREAM, imu_rows(0, 1))
    assert log.append(STREAM, imu_rows(0, 1)) == LogPosition(STREAM, 0)


def test_a_catalog_that_cannot_be_asked_fails_the_append_and_lets_the_stream_go(log: McapLog) -> None:
    log._catalog.close()
    with pytest.raises(AppendFailed, match="stream veh-van: not mended: .*closed database"):
        log.append(STREAM, imu_rows(0, 1))
    with closing(McapLog(log.directory)) as other:
        assert other.append(STREAM, imu_rows(0, 1)) == LogPosition(STREAM, 0)


def test_a_file_that_cannot_even_be_cut_lets_its_stream_go(log: McapLog) -> None:
    log.append(STREAM, imu_rows(0, 10))
    target = log._writers[STREAM]._open_file
    assert target is not None
    os.close(target.file.fileno())
    with pytest.raises(AppendFailed, match="stream veh-van, number 10: .*Bad file descriptor"):
        log.append(STREAM, imu_rows(10, 20))
    assert log.append(STREAM, imu_rows(10, 12)) == LogPosition(STREAM, 11)


def test_a_file_of_several_vehicles_names_none(log: McapLog) -> None:
    (verdict,) = (replace(row.event, vehicle="ing") for row in ONE_OF_EACH if isinstance(row.event, FixJudged))
    log.append("filtering", [Envelope(EventIdentity("filtering", "boot-1", 0), START_NS, verdict)])
    log.close()
    with next((log.directory / "filtering").glob("*.mcap")).open("rb") as file:
        assert {record.name for record in make_reader(file).iter_metadata()} == {"software", "map"}


def test_a_folder_no_stream_can_have_is_refused_and_nothing_left_open(tmp_path: Path) -> None:
    (tmp_path / "\a").mkdir()
    with pytest.raises(InputError, match="that print"):
        McapLog(tmp_path)
    assert not (tmp_path / "catalog.sqlite-wal").exists()  # SQLite takes it away with the last connection


def test_a_stream_whose_folder_is_gone_is_gone(log: McapLog) -> None:
    first = McapLog(log.directory)
    first.append("veh-car", imu_rows(0, 1))
    first.close()
    shutil.rmtree(log.directory / "veh-car")
    assert log.streams() == ()


def test_drives_of_different_years_share_a_file(log: McapLog) -> None:
    old = Envelope(EventIdentity("van", "boot-0", 0), 0, imu_row(0).event)
    for row in (imu_row(0), old, imu_row(1)):
        log.append(STREAM, [row])
    assert len(log.contents(STREAM)) == 1


def test_streams_are_written_and_read_from_several_threads(log: McapLog) -> None:
    def written(vehicle: str) -> int:
        for first in range(0, 200, 10):
            log.append(f"veh-{vehicle}", imu_rows(first, first + 10, vehicle=vehicle))
            log.next_number("veh-b")
        return sum(1 for _ in log.read(f"veh-{vehicle}"))

    with ThreadPoolExecutor(3) as threads:
        assert list(threads.map(written, ["a", "b", "c"])) == [200, 200, 200]
