"""A file's bytes by position: like a mapped file, but one that may be cut by its writer while it is read."""

import os
import zlib
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

BLOCK_BYTES = 1 << 20


class FileBytes:
    """Bytes of a file as long as it was when opened; what was cut off since reads as nothing."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("rb", buffering=0)
        self.size_bytes = os.fstat(self._file.fileno()).st_size

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def read(self, start: int, stop: int) -> bytes:
        """The bytes of [start, stop), fewer where the file ends before."""
        return os.pread(self._file.fileno(), max(stop - start, 0), start)

    def blocks(self) -> Iterator[bytes]:
        """All bytes in order, some at a time."""
        for start in range(0, self.size_bytes, BLOCK_BYTES):
            yield self.read(start, min(start + BLOCK_BYTES, self.size_bytes))

    def find(self, wanted: bytes, start: int, stop: int) -> int:
        """The first position of `wanted` from `start` on that is before `stop`, -1 if there is none."""
        for block_start in range(start, min(stop, self.size_bytes), BLOCK_BYTES):
            block_stop = min(block_start + BLOCK_BYTES, stop)
            found = self.read(block_start, block_stop + len(wanted) - 1).find(wanted)
            if found >= 0:
                return block_start + found
        return -1

    def checksum(self, start: int, stop: int) -> int:
        """The CRC-32 of the bytes of [start, stop)."""
        crc = 0
        for block_start in range(start, stop, BLOCK_BYTES):
            crc = zlib.crc32(self.read(block_start, min(block_start + BLOCK_BYTES, stop)), crc)
        return crc
