import fcntl
import shutil
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from random import Random

import pytest

from event_examples.rows import STEP_NS, imu_row, imu_rows
from trigpoint.events.envelope import LogPosition
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.stream_writer import Rotation

STREAM = "veh-van"
EVENTS = 300
FLIPS = 60


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A closed log of many small chunks, so that its catalog has several pages."""
    directory = tmp_path_factory.mktemp("written") / "log"
    with closing(McapLog(directory, rotation=Rotation(span_ns=99 * STEP_NS, span_least_bytes=0))) as log:
        for row in imu_rows(0, EVENTS):
            log.append(STREAM, [row])
    return directory


@pytest.fixture
def directory(written: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(written, tmp_path / "log"))


@pytest.fixture
def log(directory: Path) -> Iterator[McapLog]:
    with closing(McapLog(directory)) as opened:
        yield opened


def _sequences(log: McapLog) -> list[int]:
    return [logged.envelope.identity.sequence for logged in log.read(STREAM)]


def _flip(path: Path, random: Random) -> None:
    content = bytearray(path.read_bytes())
    content[random.randrange(len(content))] ^= 1 << random.randrange(8)
    path.write_bytes(content)


@pytest.mark.parametrize("seed", range(FLIPS))
def test_a_log_reads_and_grows_the_same_whatever_bit_of_its_catalog_is_flipped(directory: Path, seed: int) -> None:
    _flip(directory / "catalog.sqlite", Random(seed))
    with closing(McapLog(directory)) as log:
        assert _sequences(log) == list(range(EVENTS))
        assert log.append(STREAM, [imu_row(EVENTS)]) == LogPosition(STREAM, EVENTS)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9])
def test_a_catalog_cut_short_is_made_anew(directory: Path, share: float) -> None:
    catalog = directory / "catalog.sqlite"
    catalog.write_bytes(catalog.read_bytes()[: int(share * catalog.stat().st_size)])
    with closing(McapLog(directory)) as log:
        assert _sequences(log) == list(range(EVENTS))


def test_a_catalog_taken_away_from_an_open_log_is_made_anew(log: McapLog) -> None:
    (log.directory / "catalog.sqlite").unlink()
    assert _sequences(log) == list(range(EVENTS))
    assert log.next_number(STREAM) == EVENTS


def test_a_writer_whose_catalog_is_taken_away_goes_on_and_readers_see_all(log: McapLog) -> None:
    log.append(STREAM, [imu_row(EVENTS)])
    (log.directory / "catalog.sqlite").unlink()
    log.append(STREAM, [imu_row(EVENTS + 1)])
    with closing(McapLog(log.directory)) as reader:
        assert _sequences(reader) == list(range(EVENTS + 2))


def test_a_catalog_garbled_under_an_open_log_is_made_anew(log: McapLog) -> None:
    log.append(STREAM, [imu_row(EVENTS)])
    with closing(McapLog(log.directory)) as other:
        (log.directory / "catalog.sqlite").write_bytes(b"rubbish" * 5000)
        (log.directory / "catalog.sqlite-wal").write_bytes(b"")
        assert other.next_number(STREAM) == EVENTS + 1


def test_of_a_stream_that_is_being_written_only_what_is_entered_is_read(log: McapLog) -> None:
    log.append(STREAM, [imu_row(EVENTS)])
    last = max((log.directory / STREAM).glob("*.mcap"))
    with closing(McapLog(log.directory)) as reader, last.open("ab") as file:
        file.write(b"written, not yet durable")
        assert reader.next_number(STREAM) == EVENTS + 1


def test_a_reader_that_asks_for_the_writer_does_not_keep_one_out(log: McapLog) -> None:
    with (log.directory / STREAM / ".lock").open("rb") as asking:
        fcntl.flock(asking, fcntl.LOCK_SH)
        fcntl.flock(asking, fcntl.LOCK_UN)
        assert log.append(STREAM, [imu_row(EVENTS)]).number == EVENTS
