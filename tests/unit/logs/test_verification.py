from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from event_examples.one_each import ONE_OF_EACH
from event_examples.rows import START_NS, STEP_NS, fix_row, imu_row, imu_rows
from trigpoint.errors import InputError
from trigpoint.events.corrected import AnchorLabelled
from trigpoint.logs.catalog_verification import catalog_findings, known_files
from trigpoint.logs.findings import TopicSummary
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.stream_writer import Rotation
from trigpoint.logs.vehicle_log import write_vehicle_log
from trigpoint.logs.verification import verify

STREAM = "veh-van"


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    """A closed log of three files."""
    log = McapLog(tmp_path / "log", rotation=Rotation(span_ns=9 * STEP_NS, span_least_bytes=0))
    for first in (0, 10, 20):
        log.append(STREAM, imu_rows(first, first + 10))
    log.close()
    return log.directory


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A log of one event with the smallest schema there is."""
    path = tmp_path / "van.mcap"
    anchors = [row for row in ONE_OF_EACH if isinstance(row.event, AnchorLabelled)]
    write_vehicle_log(path, anchors, vehicle="van")  # type: ignore[arg-type]
    return path


@pytest.fixture
def whole(tmp_path: Path) -> bytes:
    path = tmp_path / "whole.mcap"
    write_vehicle_log(path, imu_rows(0, 300), vehicle="van")  # type: ignore[arg-type]
    return path.read_bytes()


def test_a_whole_log_has_no_findings(directory: Path) -> None:
    assert verify(directory).findings == ()


def test_files_and_boots_are_summed_up(directory: Path) -> None:
    verification = verify(directory)
    assert [file.count for file in verification.files] == [10, 10, 10]
    assert [(boot.source, boot.count, boot.missing) for boot in verification.boots] == [("van", 30, 0)]


def test_what_a_writer_adds_after_the_catalog_was_looked_at_is_nothing_wrong(directory: Path) -> None:
    with closing(McapLog(directory)) as log:
        known = known_files(directory)
        log.append(STREAM, imu_rows(30, 40))
        files = verify(directory).files
        assert sum(file.count for file in files) == 40
        assert catalog_findings(directory, known, files, ()) == ()


def test_topics_tell_counts_and_times(tmp_path: Path) -> None:
    path = tmp_path / "van.mcap"
    write_vehicle_log(path, [imu_row(0), fix_row(1), imu_row(2)], vehicle="van")  # type: ignore[list-item]
    (file,) = verify(path).files
    gnss = TopicSummary("veh/van/obs/gnss", "foxglove.LocationFix", 1, START_NS + STEP_NS, START_NS + STEP_NS)
    imu = TopicSummary("veh/van/obs/imu", "trigpoint.v1.ImuMeasured", 2, START_NS, START_NS + 2 * STEP_NS)
    assert file.topics == (gnss, imu)


def test_missing_sequences_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "van.mcap"
    write_vehicle_log(path, [imu_row(0), imu_row(5)], vehicle="van")  # type: ignore[list-item]
    assert verify(path).boots[0].missing == 4


def test_a_missing_file_of_a_stream_is_found(directory: Path) -> None:
    (directory / STREAM / "000000000010.mcap").unlink()
    gap, missing = verify(directory).findings
    assert (gap.kind, gap.detail) == ("number gap", "first event has number 20, expected 10")
    assert (missing.kind, missing.path.name, missing.lost_messages) == ("missing file", "000000000010.mcap", 10)


def test_a_missing_last_file_is_found_by_the_catalog(directory: Path) -> None:
    (directory / STREAM / "000000000020.mcap").unlink()
    (finding,) = verify(directory).findings
    assert (finding.kind, finding.path.name, finding.lost_messages) == ("missing file", "000000000020.mcap", 10)


def test_an_identity_that_is_there_twice_is_found(tmp_path: Path) -> None:
    path = tmp_path / "van.mcap"
    write_vehicle_log(path, [imu_row(0), imu_row(0)], vehicle="van")  # type: ignore[list-item]
    assert [finding.kind for finding in verify(path).findings] == ["repeated identity"]


def test_any_flipped_bit_of_a_file_is_found(small: Path) -> None:
    content = small.read_bytes()
    unseen = [offset for offset in range(len(content)) if not _found(small, content, offset)]
    assert unseen == []


def _found(path: Path, content: bytes, offset: int) -> bool:
    """Whether a bit flipped in this byte is found; which of its eight goes round with the offset."""
    flipped = bytearray(content)
    flipped[offset] ^= 1 << (offset % 8)
    path.write_bytes(flipped)
    return bool(verify(path).findings)


def test_a_checksum_set_to_zero_is_found_though_foreign_files_may_leave_it_out(small: Path) -> None:
    content = small.read_bytes()
    small.write_bytes(content[:-12] + bytes(4) + content[-8:])  # the footer ends with it, then comes the magic
    assert "summary has checksum" in verify(small).findings[0].detail


@given(data=st.data())
@settings(
    max_examples=100, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_any_garbling_of_a_file_is_found_and_nothing_else_happens(
    whole: bytes, tmp_path: Path, data: st.DataObject
) -> None:
    start = data.draw(st.integers(0, len(whole)))
    stop = data.draw(st.integers(start, min(start + 100, len(whole))))
    garbled = whole[:start] + data.draw(st.binary(max_size=100)) + whole[stop:]
    (tmp_path / "garbled.mcap").write_bytes(garbled)
    assert bool(verify(tmp_path / "garbled.mcap").findings) == (garbled != whole)


def test_any_truncation_of_a_file_is_found(small: Path) -> None:
    content = small.read_bytes()
    unseen = [size for size in range(0, len(content), 3) if not _found_cut(small, content[:size])]
    assert unseen == []


def _found_cut(path: Path, content: bytes) -> bool:
    path.write_bytes(content)
    return bool(verify(path).findings)


def test_bytes_after_the_end_are_found(small: Path) -> None:
    small.write_bytes(small.read_bytes() + b"\0")
    assert [finding.kind for finding in verify(small).findings] == ["unfinished"]


def test_a_place_without_logs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no \.mcap file there"):
        verify(tmp_path)


def test_a_place_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="gone"):
        verify(tmp_path / "gone")
