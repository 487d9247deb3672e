import shutil
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from mcap.reader import make_reader

from event_examples.rows import imu_rows
from trigpoint.errors import LogDamaged
from trigpoint.events.envelope import LogPosition
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.verification import verify

STREAM = "veh-van"
WRITES_UNTIL_KILLED = """
import os, signal, sys
from pathlib import Path
from event_examples.rows import imu_rows
from trigpoint.logs.mcap_log import McapLog
log = McapLog(Path(sys.argv[1]))
log.append("veh-van", imu_rows(0, 50))
log.append("veh-van", imu_rows(50, 80))
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log whose writer was killed after 80 acknowledged events."""
    directory = tmp_path_factory.mktemp("killed")
    import_paths = ":".join(path for path in sys.path if path)
    command = [sys.executable, "-c", WRITES_UNTIL_KILLED, str(directory)]
    killed = subprocess.run(command, env={"PYTHONPATH": import_paths}, check=False, timeout=60)
    assert killed.returncode == -9
    return directory


@pytest.fixture
def crashed(killed: Path, tmp_path: Path) -> Path:
    """A copy of it, to be written to."""
    return Path(shutil.copytree(killed, tmp_path / "crashed"))


def _file(directory: Path) -> Path:
    return directory / STREAM / "000000000000.mcap"


def _sequences(directory: Path) -> list[int]:
    with closing(McapLog(directory)) as log:
        return [logged.envelope.identity.sequence for logged in log.read(STREAM)]


def _append(directory: Path, first: int, stop: int) -> LogPosition:
    with closing(McapLog(directory)) as log:
        return log.append(STREAM, imu_rows(first, stop))


def test_every_acknowledged_event_survives_a_kill(crashed: Path) -> None:
    assert _sequences(crashed) == list(range(80))


def test_without_its_catalog_a_killed_writers_log_says_the_same(crashed: Path) -> None:
    (crashed / "catalog.sqlite").unlink()
    assert _sequences(crashed) == list(range(80))


def test_verification_calls_a_killed_writers_file_unfinished(crashed: Path) -> None:
    assert {finding.kind for finding in verify(crashed).findings} == {"unfinished"}


def test_the_next_writer_ends_the_file_and_goes_on_with_the_numbers(crashed: Path) -> None:
    assert _append(crashed, 80, 90) == LogPosition(STREAM, 89)
    assert _sequences(crashed) == list(range(90))
    assert verify(crashed).findings == ()


def test_a_mended_file_is_byte_for_byte_the_one_its_writer_would_have_ended(crashed: Path, tmp_path: Path) -> None:
    with closing(McapLog(tmp_path / "orderly")) as log:
        log.append(STREAM, imu_rows(0, 50))
        log.append(STREAM, imu_rows(50, 80))
    _append(crashed, 80, 81)
    assert _file(crashed).read_bytes() == _file(tmp_path / "orderly").read_bytes()


def test_a_mended_file_passes_the_mcap_reader_with_checksums(crashed: Path) -> None:
    _append(crashed, 80, 81)
    with _file(crashed).open("rb") as file:
        assert sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages()) == 80


@pytest.mark.parametrize("torn_bytes", [1, 8, 200])
def test_a_torn_tail_is_cut_off(crashed: Path, torn_bytes: int) -> None:
    with _file(crashed).open("ab") as file:
        file.write(b"\x06" + b"\x30" * (torn_bytes - 1))
    assert _sequences(crashed) == list(range(80))
    _append(crashed, 80, 81)
    assert verify(crashed).findings == ()


def test_an_acknowledged_chunk_that_is_gone_is_not_papered_over(crashed: Path) -> None:
    content = _file(crashed).read_bytes()
    _file(crashed).write_bytes(content[: content.rfind(b"zstd") + 100])  # into the last chunk
    with pytest.raises(LogDamaged, match="events from number 50 on were durable and are gone"):
        _append(crashed, 80, 81)


def test_reading_names_an_acknowledged_chunk_that_is_gone(crashed: Path) -> None:
    content = _file(crashed).read_bytes()
    _file(crashed).write_bytes(content[: content.rfind(b"zstd") + 100])
    with pytest.raises(LogDamaged, match="30 messages lost"):
        _sequences(crashed)


def test_damage_before_the_tail_is_not_mended(crashed: Path) -> None:
    (crashed / "catalog.sqlite").unlink()
    content = bytearray(_file(crashed).read_bytes())
    content[content.find(b"zstd") + 100] ^= 1
    _file(crashed).write_bytes(content)
    with pytest.raises(LogDamaged, match="50 messages lost"):
        _append(crashed, 80, 81)


def test_a_file_begun_and_never_written_is_taken_away(crashed: Path) -> None:
    begun = crashed / STREAM / "000000000080.mcap"
    begun.write_bytes(b"\x89MCAP")
    assert _append(crashed, 80, 81) == LogPosition(STREAM, 80)
    assert _sequences(crashed) == list(range(81))
