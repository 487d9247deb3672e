"""A damaged LAS or LAZ file is refused by its name, whatever it does to its reader, and the next is read."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from las_files.writing import (
    CHUNK_SIZE_AT,
    EVLR_COUNT_AT,
    ITEM_COUNT_AT,
    VLR_COUNT_AT,
    chunk_table_at,
    las,
    laszip_record_at,
    overwritten,
    truncated,
)
from trigpoint.errors import InputError
from trigpoint_vehicle.las_reader import LasReader


@pytest.fixture(scope="module")
def reader() -> Iterator[LasReader]:
    with LasReader() as reader:
        yield reader


def refused(reader: LasReader, path: Path) -> str:
    """Why a file is refused; and a good file is read after it."""
    with pytest.raises(InputError) as caught:
        reader.points(path)
    assert reader.points(las(path.with_name("good.laz"))).intensity.tolist() == [700.0, 800.0]
    said = str(caught.value)
    assert said.startswith(f"{path}: ")
    return said


def test_a_file_whose_chunks_would_fill_the_memory_aborts_only_its_reader(reader: LasReader, tmp_path: Path) -> None:
    bad = las(tmp_path / "bad.laz")
    overwritten(bad, laszip_record_at(bad) + CHUNK_SIZE_AT, 2**31)
    assert "SIGABRT" in refused(reader, bad)


def test_a_file_on_which_native_code_panics_is_refused_with_what_that_says(reader: LasReader, tmp_path: Path) -> None:
    bad = las(tmp_path / "bad.laz")
    overwritten(bad, laszip_record_at(bad) + ITEM_COUNT_AT, 0, size=2)
    assert "decoding failed: attempt to calculate the remainder" in refused(reader, bad)


def test_a_file_that_claims_more_records_than_can_be_counted_is_given_up(tmp_path: Path) -> None:
    bad = overwritten(las(tmp_path / "bad.las"), VLR_COUNT_AT, 2**32 - 1)
    with LasReader(limit_s=0.5) as impatient, pytest.raises(InputError, match=r"bad.las: .* takes more than 0.5 s"):
        impatient.points(bad)


def test_a_file_that_claims_an_endless_record_is_refused(reader: LasReader, tmp_path: Path) -> None:
    bad = overwritten(las(tmp_path / "bad.laz"), EVLR_COUNT_AT, 7)
    assert "no LAS or LAZ file that can be read: MemoryError" in refused(reader, bad)


def test_a_file_with_more_chunks_than_points_is_refused_with_both(reader: LasReader, tmp_path: Path) -> None:
    bad = las(tmp_path / "bad.laz")
    overwritten(bad, chunk_table_at(bad) + 4, 2**32 - 1)
    assert "a table of 4294967295 chunks for 2 points" in refused(reader, bad)


def test_a_truncated_file_is_refused(reader: LasReader, tmp_path: Path) -> None:
    assert "no LAS or LAZ file that can be read" in refused(reader, truncated(las(tmp_path / "bad.las"), lost=1))


def test_a_file_that_is_not_there_is_refused(reader: LasReader, tmp_path: Path) -> None:
    assert "cannot be read: [Errno 2]" in refused(reader, tmp_path / "gone.laz")
