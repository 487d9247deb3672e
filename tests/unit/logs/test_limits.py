"""Files made to fill memory: what they hold is refused by size, and what is whole beside it is still read."""

import struct
import subprocess
import sys
from pathlib import Path

import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.records import Chunk, DataEnd, Header, McapRecord, Metadata
from mcap.records import Schema as McapSchema

from event_examples.rows import imu_rows
from trigpoint.logs.chunks import CHUNK_LIMIT_BYTES, record_bytes
from trigpoint.logs.mcap_scan import (
    DAMAGES_LIMIT,
    DEFINITIONS_LIMIT_BYTES,
    METADATA_LIMIT,
    RECORD_LIMIT_BYTES,
    McapScan,
)
from trigpoint.logs.vehicle_log import write_vehicle_log
from trigpoint.logs.verification import verify

MIB = 1024 * 1024
MAGIC = b"\x89MCAP0\r\n"
VERIFIES = """
import resource, sys
from pathlib import Path
from trigpoint.logs.verification import verify
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
verify(Path(sys.argv[1]))
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024)
"""


def _file(path: Path, *records: bytes) -> Path:
    path.write_bytes(MAGIC + record_bytes(Header(profile="", library="other")) + b"".join(records))
    return path


def _zeros(size_bytes: int, *, size_known: bool) -> bytes:
    """So many zero bytes, compressed a little at a time."""
    compressor = zstandard.ZstdCompressor(level=1).compressobj(size=size_bytes if size_known else -1)
    return b"".join([*(compressor.compress(bytes(MIB)) for _ in range(size_bytes // MIB)), compressor.flush()])


def _chunk(data: bytes, said_bytes: int, compression: str = "zstd") -> bytes:
    chunk = Chunk(
        compression=compression,
        data=data,
        message_start_time=0,
        message_end_time=0,
        uncompressed_crc=0,
        uncompressed_size=said_bytes,
    )
    return record_bytes(chunk)


def _reasons(path: Path) -> list[str]:
    scan = McapScan(path)
    for _ in scan.chunks():
        pass
    return [damage.reason for damage in scan.damages]


def _grown_mib(path: Path) -> int:
    """How much memory a process's peak grows by verifying a file."""
    command = [sys.executable, "-c", VERIFIES, str(path)]
    import_paths = ":".join(path for path in sys.path if path)
    done = subprocess.run(command, env={"PYTHONPATH": import_paths}, capture_output=True, text=True, check=True)
    return int(done.stdout)


@pytest.mark.parametrize("size_known", [True, False])
def test_a_chunk_that_says_it_is_too_large_is_refused_with_the_limit(tmp_path: Path, *, size_known: bool) -> None:
    size_bytes = CHUNK_LIMIT_BYTES + MIB
    path = _file(tmp_path / "bomb.mcap", _chunk(_zeros(size_bytes, size_known=size_known), size_bytes))
    assert f"chunk says it holds {size_bytes} bytes, at most {CHUNK_LIMIT_BYTES} are unpacked" in _reasons(path)[0]


def test_a_chunk_that_is_larger_than_it_says_is_refused_without_unpacking_it(tmp_path: Path) -> None:
    bomb = _zeros(256 * MIB, size_known=False)
    path = _file(tmp_path / "bomb.mcap", _chunk(bomb, MIB))
    assert "does not decompress" in _reasons(path)[0]
    assert _grown_mib(path) < 100


def test_a_frame_that_says_another_size_than_its_chunk_is_refused_with_the_limit(tmp_path: Path) -> None:
    bomb = _zeros(256 * MIB, size_known=True)
    path = _file(tmp_path / "bomb.mcap", _chunk(bomb, MIB))
    assert f"at most {CHUNK_LIMIT_BYTES} are unpacked" in _reasons(path)[0]
    assert _grown_mib(path) < 100


def test_an_unknown_compression_is_named(tmp_path: Path) -> None:
    assert "compressed with 'brotli'" in _reasons(_file(tmp_path / "odd.mcap", _chunk(b"x", 1, "brotli")))[0]


@pytest.mark.parametrize("opcode", [Opcode.CHUNK, Opcode.METADATA, Opcode.SCHEMA])
def test_a_record_too_large_to_be_read_is_refused_with_the_limit(tmp_path: Path, opcode: Opcode) -> None:
    path = _file(tmp_path / "large.mcap", struct.pack("<BQ", opcode, RECORD_LIMIT_BYTES + 1))
    with path.open("ab") as file:
        file.truncate(RECORD_LIMIT_BYTES + 1000)  # sparse
    assert f"of {RECORD_LIMIT_BYTES + 1} bytes, at most {RECORD_LIMIT_BYTES} are read" in _reasons(path)[0]


def test_a_large_attachment_is_passed_over_without_being_read(tmp_path: Path) -> None:
    path = _file(tmp_path / "large.mcap", struct.pack("<BQ", Opcode.ATTACHMENT, 512 * MIB))
    end = path.stat().st_size + 512 * MIB
    with path.open("r+b") as file:
        file.truncate(end)  # sparse
        file.seek(end)
        file.write(record_bytes(DataEnd(data_section_crc=0)))
    assert _reasons(path) == ["file does not end with a footer"]


def test_definitions_are_kept_up_to_a_limit(tmp_path: Path) -> None:
    count = DEFINITIONS_LIMIT_BYTES // MIB + 2
    schemas = (McapSchema(id=number, data=bytes(MIB), encoding="", name="x") for number in range(1, count))
    records = [*map(record_bytes, schemas)]
    assert f"at most {DEFINITIONS_LIMIT_BYTES}" in _reasons(_file(tmp_path / "many.mcap", *records))[0]


def test_metadata_records_are_kept_up_to_a_limit(tmp_path: Path) -> None:
    record = record_bytes(Metadata(name="", metadata={}))
    assert f"more than {METADATA_LIMIT}" in _reasons(_file(tmp_path / "many.mcap", record * (METADATA_LIMIT + 1)))[0]


def test_damages_are_listed_up_to_a_limit_and_the_last_says_so(tmp_path: Path) -> None:
    bad: McapRecord = McapSchema(id=1, data=b"", encoding="", name="x")
    record = record_bytes(bad)[:-1] + b"\xff"  # one byte of data is said to follow
    reasons = _reasons(_file(tmp_path / "many.mcap", record * (2 * DAMAGES_LIMIT)))
    assert len(reasons) == DAMAGES_LIMIT + 1
    assert "what follows is not listed" in reasons[-1]


def test_a_file_with_a_bomb_gives_everything_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "van.mcap"
    write_vehicle_log(path, imu_rows(0, 100), vehicle="van")  # type: ignore[arg-type]
    content = path.read_bytes()
    first = content.index(b"zstd") - 41  # where the chunk begins
    path.write_bytes(content[:first] + _chunk(b"", 2**40) + content[first:])
    verification = verify(path)
    assert [file.count for file in verification.files] == [100]
    assert f"at most {CHUNK_LIMIT_BYTES} are unpacked" in verification.findings[0].detail
