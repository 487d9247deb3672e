"""Files made to hurt: chunks that unpack to far more than they say. The process stays small and says what is wrong."""

import resource
import struct
import subprocess
import sys
import zlib
from functools import lru_cache
from pathlib import Path

import pytest
import zstandard

from command_runs.processes import CLEAN

MAGIC = b"\x89MCAP0\r\n"
HEADER, CHUNK, FOOTER, DATA_END = 0x01, 0x06, 0x02, 0x0F
BOMB_BYTES = 2 * 1024**3  # unpacked; some 65 kB as zstd packs zeros
MEMORY_LIMIT_BYTES = (
    1536 * 1024**2
)  # of address space beyond which the process would be killed: Zenoh and numpy need most


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def record(code: int, body: bytes) -> bytes:
    return struct.pack("<BQ", code, len(body)) + body


@lru_cache(maxsize=2)
def packed_zeros(*, size_said: bool) -> bytes:
    """Two gigabytes of zeros, packed; with or without their size in the frame's header."""
    packer = zstandard.ZstdCompressor(level=3, write_content_size=size_said).compressobj(
        size=BOMB_BYTES if size_said else -1
    )
    part = bytes(16 * 1024**2)
    parts = [packer.compress(part) for _ in range(BOMB_BYTES // len(part))]
    return b"".join([*parts, packer.flush()])


def crafted(folder: Path, *, said_bytes: int, size_said: bool) -> Path:
    """A log whose only chunk unpacks to two gigabytes and says it holds `said_bytes`."""
    packed = packed_zeros(size_said=size_said)
    chunk = (
        struct.pack("<QQQI", 0, 1, said_bytes, zlib.crc32(b"")) + text("zstd") + struct.pack("<Q", len(packed)) + packed
    )
    records = [
        record(HEADER, text("") + text("")),
        record(CHUNK, chunk),
        record(DATA_END, struct.pack("<I", 0)),
        record(FOOTER, struct.pack("<QQI", 0, 0, 0)),
    ]
    path = folder / "veh-a.mcap"
    path.write_bytes(MAGIC + b"".join(records) + MAGIC)
    return path


def limited() -> None:
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY_LIMIT_BYTES, MEMORY_LIMIT_BYTES))


def run(*words: str | Path) -> "subprocess.CompletedProcess[str]":
    """The command in a process that may not grow."""
    command = [sys.executable, "-m", "trigpoint_cli", *map(str, words)]
    return subprocess.run(command, env=CLEAN, capture_output=True, text=True, preexec_fn=limited, check=False)


@pytest.mark.parametrize(
    ("words", "said_bytes", "size_said"),
    [
        (("ingest",), 1000, True),
        (("ingest",), 1000, False),
        (("log", "verify"), BOMB_BYTES, False),
        (("log", "verify"), 2**64 - 1, True),
    ],
)
def test_a_chunk_that_unpacks_to_too_much_is_damage_and_costs_no_memory(
    tmp_path: Path, words: tuple[str, ...], said_bytes: int, size_said: bool
) -> None:
    path = crafted(tmp_path, said_bytes=said_bytes, size_said=size_said)
    more = ("--data", tmp_path / "data") if words == ("ingest",) else ()
    finished = run(*words, path, *more)
    assert finished.returncode == 2, finished.stderr
    assert "chunk" in finished.stderr
    assert "unexpected" not in finished.stderr
