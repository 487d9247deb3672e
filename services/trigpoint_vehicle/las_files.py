"""Points of LAS and LAZ files; the only home of the library that reads them."""

import os
import struct
from dataclasses import dataclass
from pathlib import Path

import laspy
import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint_vehicle.cloud_conversion import POINTS_LIMIT

Floats = NDArray[np.float64]

GPS_TIME = "gps_time"
CHUNK_TABLE_HEAD_BYTES = 8  # its version and its length
PANIC = "PanicException"  # what native code that panics raises: no Exception, and its type is nowhere to be imported
UNREADABLE = (  # what a damaged file makes of itself
    laspy.errors.LaspyException,
    ValueError,
    RuntimeError,
    EOFError,
    LookupError,
    MemoryError,
    OverflowError,
    struct.error,
)


@dataclass(frozen=True, slots=True)
class LasPoints:
    """What of a LAS file is used: points (n, 3) in its own CRS, intensity (n,), and GPS time (n,) in s or None."""

    point: Floats
    intensity: NDArray[np.float32]
    time_s: Floats | None


def las_points(path: Path) -> LasPoints:
    """The points of a file. Raises InputError naming the file and what of it is wrong.

    A damaged file may also abort the process, keep it busy for hours, or have it ask for all memory: LasReader.
    """
    try:
        return _points(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    except UNREADABLE as error:
        said = str(error) or type(error).__name__
        raise InputError(f"{path}: no LAS or LAZ file that can be read: {said}") from error
    except BaseException as error:
        if type(error).__name__ != PANIC:
            raise
        raise InputError(f"{path}: no LAS or LAZ file that can be read: decoding failed: {error}") from error


def _points(path: Path) -> LasPoints:
    with laspy.open(path) as file:
        if file.header.point_count > POINTS_LIMIT:
            raise InputError(f"{path}: {file.header.point_count} points, limit {POINTS_LIMIT}")
        if file.header.are_points_compressed:
            _require_chunks(path, file.header)
        read = file.read()
    has_time = GPS_TIME in read.point_format.dimension_names
    return LasPoints(
        point=np.column_stack((read.x, read.y, read.z)).astype(np.float64),
        intensity=np.asarray(read.intensity, dtype=np.float32),
        time_s=np.asarray(read.gps_time, dtype=np.float64) if has_time else None,
    )


def _require_chunks(path: Path, header: laspy.LasHeader) -> None:
    """Nothing, if a LAZ file's table of chunks has no more of them than points: the library makes room for what that
    says before it reads any (LASzip's format: the table's place, then its version and its length)."""
    with path.open("rb") as file:
        file.seek(header.offset_to_point_data)
        place = int.from_bytes(file.read(8), "little", signed=True)
        if place < 0:  # it was written to a stream, and the place stands at the file's end
            file.seek(-8, os.SEEK_END)
            place = int.from_bytes(file.read(8), "little", signed=True)
        size = file.seek(0, os.SEEK_END)
        if not 0 <= place <= size - CHUNK_TABLE_HEAD_BYTES:
            raise InputError(f"{path}: its table of chunks is at byte {place} of {size}: damaged or cut off")
        file.seek(place)
        count = int.from_bytes(file.read(CHUNK_TABLE_HEAD_BYTES)[4:], "little")
    if count > max(header.point_count, 1):
        raise InputError(f"{path}: a table of {count} chunks for {header.point_count} points")
