import shutil
from contextlib import closing
from pathlib import Path

import pytest

from damaged_logs.damaging import Expected, Remains, remains, written_log
from event_examples.rows import imu_row
from trigpoint.errors import InputError
from trigpoint.events.envelope import LogPosition
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.numbering import NumberedPiece, Piece, numbered
from trigpoint.logs.recovery import MissingSequences, StreamRecovery, recover
from trigpoint.logs.seals import seal_finished
from trigpoint.logs.verification import verify

EVENTS = 400


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Expected]:
    """A log of two streams of two files of ten chunks of twenty events, and what it holds."""
    folder = tmp_path_factory.mktemp("written") / "log"
    return folder, written_log(folder, events=EVENTS)


@pytest.fixture
def source(written: tuple[Path, Expected], tmp_path: Path) -> Path:
    """That log, to be damaged."""
    return shutil.copytree(written[0], tmp_path / "source")


@pytest.fixture
def expected(written: tuple[Path, Expected]) -> Expected:
    return written[1]


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "out"


def _file(directory: Path, first: int) -> Path:
    return directory / "veh-van" / f"{first:012d}.mcap"


def _chunk_at(content: bytes | bytearray, index: int) -> int:
    """Somewhere inside the data of a chunk of a file."""
    offset = -1
    for _ in range(index + 1):
        offset = content.index(b"zstd", offset + 1)
    return offset + 40


def _flip(path: Path, *chunks: int) -> None:
    content = bytearray(path.read_bytes())
    for index in chunks:
        content[_chunk_at(content, index)] ^= 1
    path.write_bytes(content)


def _van(source: Path, out: Path) -> StreamRecovery:
    (recovered,) = [one for one in recover(source, out) if one.stream == "veh-van"]
    return recovered


def _lost(source: Path, out: Path) -> tuple[tuple[int, int], ...]:
    return _van(source, out).lost_ranges


def test_of_a_whole_log_the_files_come_out_byte_for_byte(source: Path, out: Path) -> None:
    seal_finished(source / "veh-van")
    assert _lost(source, out) == ()
    assert {path.name: path.read_bytes() for path in (out / "veh-van").glob("0*")} == {
        path.name: path.read_bytes() for path in (source / "veh-van").glob("0*")
    }


def test_a_lost_chunk_keeps_its_numbers_free(source: Path, out: Path, expected: Expected) -> None:
    _flip(_file(source, 0), 3)
    assert _lost(source, out) == ((60, 80),)
    assert remains(out, expected) == Remains(2 * EVENTS - 20, 0)


def test_which_identities_are_missing_is_said(source: Path, out: Path) -> None:
    _flip(_file(source, 0), 3)
    missing = MissingSequences(source="van", boot_id="boot-1", start=60, stop=80)
    assert _van(source, out).missing == (missing,)


def test_several_losses_in_one_file_are_kept_apart(source: Path, out: Path, expected: Expected) -> None:
    (source / "catalog.sqlite").unlink()
    _flip(_file(source, 0), 0, 4, 5)
    assert _lost(source, out) == ((0, 20), (80, 120))
    assert remains(out, expected) == Remains(2 * EVENTS - 60, 0)


def test_a_recovered_log_verifies_and_names_what_is_lost(source: Path, out: Path) -> None:
    _flip(_file(source, 0), 3)
    recover(source, out)
    verification = verify(out)
    assert verification.findings == ()
    assert [(stream, one.first_number, one.stop_number, one.reason) for stream, one in verification.absences] == [
        ("veh-van", 60, 80, "lost")
    ]


def test_a_recovered_log_is_written_on_from_its_next_number(source: Path, out: Path) -> None:
    _file(source, 200).unlink()
    assert _lost(source, out) == ((200, 400),)
    with closing(McapLog(out)) as log:
        assert log.append("veh-van", [imu_row(400)]) == LogPosition("veh-van", 400)


def test_a_stream_whose_folder_is_gone_is_lost_by_name(source: Path, out: Path) -> None:
    shutil.rmtree(source / "veh-van")
    recovered = _van(source, out)
    assert (recovered.count, recovered.lost_ranges) == (0, ((0, 400),))


def test_a_cut_file_gives_all_its_whole_chunks(source: Path, out: Path, expected: Expected) -> None:
    content = _file(source, 0).read_bytes()
    _file(source, 0).write_bytes(content[: _chunk_at(content, 7)])
    assert _lost(source, out) == ((140, 200),)
    assert remains(out, expected) == Remains(2 * EVENTS - 60, 0)


def test_without_a_catalog_the_end_of_the_last_file_is_said_to_be_unknown(source: Path, out: Path) -> None:
    (source / "catalog.sqlite").unlink()
    content = _file(source, 200).read_bytes()
    _file(source, 200).write_bytes(content[: _chunk_at(content, 7)])
    recovered = _van(source, out)
    assert (recovered.count, recovered.lost_ranges, recovered.end_unknown) == (340, (), True)


def test_a_file_of_rubbish_costs_its_own_events_only(source: Path, out: Path, expected: Expected) -> None:
    _file(source, 0).write_bytes(b"rubbish" * 1000)
    assert _lost(source, out) == ((0, 200),)
    assert remains(out, expected) == Remains(2 * EVENTS - 200, 0)


def test_the_source_is_not_touched(source: Path, out: Path) -> None:
    _flip(_file(source, 0), 3)
    (source / "catalog.sqlite").write_bytes(b"rubbish" * 1000)
    before = {path: path.read_bytes() for path in source.rglob("*") if path.is_file()}
    recover(source, out)
    assert {path: path.read_bytes() for path in source.rglob("*") if path.is_file()} == before


def test_a_directory_that_holds_something_is_not_written_to(source: Path, out: Path) -> None:
    out.mkdir()
    (out / "note").touch()
    with pytest.raises(InputError, match="holds something already"):
        recover(source, out)


def test_a_place_without_a_log_is_refused(tmp_path: Path, out: Path) -> None:
    with pytest.raises(InputError, match="no folder with numbered files"):
        recover(tmp_path, out)


def test_what_a_first_recovery_lost_stays_lost_in_the_second(source: Path, out: Path, tmp_path: Path) -> None:
    _flip(_file(source, 0), 3)
    recover(source, out)
    assert _lost(out, tmp_path / "second") == ()
    assert [(one.first_number, one.stop_number) for _, one in verify(tmp_path / "second").absences] == [(60, 80)]


def test_after_an_unknown_loss_numbers_are_counted_back_from_what_follows() -> None:
    pieces = [Piece(0, 10), Piece(100, None, lost=True), Piece(200, 10), Piece(300, 5)]
    found = numbered(pieces, first_number=0, stop_number=40, known={})
    assert [(piece.number, piece.certain) for piece in found] == [(0, True), (25, True), (35, True)]


def test_with_nothing_to_count_back_from_numbers_are_the_lowest_possible_and_say_so() -> None:
    pieces = [Piece(0, 10), Piece(100, None, lost=True), Piece(200, 10)]
    found = numbered(pieces, first_number=0, stop_number=None, known={})
    assert found == (NumberedPiece(0, 10, 0), NumberedPiece(200, 10, 10, certain=False))


def test_between_two_unknown_losses_what_was_known_of_a_piece_counts() -> None:
    pieces = [Piece(0, None, lost=True), Piece(100, 10), Piece(200, None, lost=True), Piece(300, 10)]
    found = numbered(pieces, first_number=0, stop_number=100, known={100: (30, 10)})
    assert [piece.number for piece in found] == [30, 90]


def test_what_was_known_of_a_piece_with_another_count_is_not_believed() -> None:
    found = numbered([Piece(0, 10), Piece(100, 10)], first_number=0, stop_number=None, known={100: (30, 11)})
    assert [piece.number for piece in found] == [0, 10]


def _with_flips(source: Path, *places: tuple[int, int]) -> None:
    content = bytearray(_file(source, 0).read_bytes())
    for at, bit in places:
        content[at] ^= bit
    _file(source, 0).write_bytes(content)


def _frames(source: Path) -> list[int]:
    """Where each record of the data section of the first file begins."""
    content, offset, found = _file(source, 0).read_bytes(), 8, []
    while content[offset] != 0x0F:
        found.append(offset)
        offset += 9 + int.from_bytes(content[offset + 1 : offset + 9], "little")
    return [*found, offset]


@pytest.mark.parametrize("bit", [1 << 2, 1 << 8, 1 << 9, 1 << 10])
@pytest.mark.parametrize("index", [0, 1, 5, 6, 9, 12])
def test_a_wrong_length_costs_the_events_of_no_other_chunk(source: Path, out: Path, index: int, bit: int) -> None:
    (source / "catalog.sqlite").unlink()
    _with_flips(source, (_frames(source)[index] + 1 + (bit > 255), bit if bit < 256 else bit >> 8))
    assert _van(source, out).count >= EVENTS - 20


@pytest.mark.parametrize("bit", [1, 2, 4, 8, 16, 128])
@pytest.mark.parametrize("index", [0, 3, 4, -1])
def test_a_record_of_another_kind_costs_no_event_of_another(source: Path, out: Path, index: int, bit: int) -> None:
    (source / "catalog.sqlite").unlink()
    _with_flips(source, (_frames(source)[index], bit))
    recovered = _van(source, out)
    assert recovered.count >= EVENTS - 20
    assert recovered.count + recovered.lost_count == EVENTS
