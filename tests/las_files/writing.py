"""Small files written by the library that reads them, and damages where LASzip's format says what stands."""

from pathlib import Path

import laspy
import numpy as np

VLR_COUNT_AT, EVLR_COUNT_AT, EVLR_COUNT_SIZE = 100, 243, 4  # in a header of LAS 1.4
VLR_HEAD_SIZE, CHUNK_SIZE_AT, ITEM_COUNT_AT = 54, 12, 32  # in LASzip's record: points a chunk, items a point


def las(path: Path, *, time_s: tuple[float, ...] = (1000.0, 1000.25)) -> Path:
    """Two points about 652,000 east and 6,862,000 north, with GPS times."""
    header = laspy.LasHeader(point_format=1, version="1.4")
    header.offsets, header.scales = np.array([652_000.0, 6_862_000.0, 0.0]), np.full(3, 0.001)
    data = laspy.LasData(header)
    data.x, data.y = np.array([652_001.5, 652_002.5]), np.array([6_862_003.0, 6_862_004.0])
    data.z, data.intensity, data.gps_time = np.array([5.0, 6.0]), np.array([700, 800]), np.array(time_s)
    data.write(path)
    return path


def overwritten(path: Path, at: int, value: int, *, size: int = 4) -> Path:
    """The file with another number of `size` bytes from byte `at` on."""
    content = bytearray(path.read_bytes())
    content[at : at + size] = value.to_bytes(size, "little")
    path.write_bytes(content)
    return path


def truncated(path: Path, *, lost: int) -> Path:
    """The file without its last bytes."""
    path.write_bytes(path.read_bytes()[:-lost])
    return path


def laszip_record_at(path: Path) -> int:
    """Where LASzip's record begins: the first after the header."""
    return int.from_bytes(path.read_bytes()[94:96], "little") + VLR_HEAD_SIZE


def chunk_table_at(path: Path) -> int:
    """Where the table of a LAZ file's chunks begins."""
    content = path.read_bytes()
    begin = int.from_bytes(content[96:100], "little")
    return int.from_bytes(content[begin : begin + 8], "little")
