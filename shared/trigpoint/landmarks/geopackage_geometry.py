"""GeoPackage geometries as bytes (OGC 12-128r18, 2.1.3: header "GP", then WKB), two dimensions only."""

import struct
from collections.abc import Sequence
from functools import lru_cache

from trigpoint.errors import InputError

Coordinates = tuple[tuple[float, float], ...]

LITTLE_ENDIAN = 0b1
EMPTY = 0b10000  # bit 4 of the flags
ENVELOPE_XY = 0b10  # envelope indicator 1, bits 1 to 3 of the flags
HEADER_SIZE = 8
ENVELOPE_SIZES = (0, 32, 48, 48, 64)  # bytes, by envelope indicator
WKB_POINT, WKB_LINE_STRING = 1, 2

_POINT = struct.Struct("<2sBBiBIdd")
_LINE_HEADER = struct.Struct("<2sBBiddddBII")


def encoded_point(x: float, y: float, *, srs_id: int) -> bytes:
    """A point; without envelope, as it is one."""
    return _POINT.pack(b"GP", 0, LITTLE_ENDIAN, srs_id, 1, WKB_POINT, x, y)


def encoded_line(points: Sequence[tuple[float, float]], *, srs_id: int) -> bytes:
    """A line of two points or more, with its envelope. Raises InputError for fewer."""
    if len(points) < 2:
        raise InputError(f"a line of {len(points)} points: 2 is the least")
    x, y = [point[0] for point in points], [point[1] for point in points]
    envelope = (min(x), max(x), min(y), max(y))
    header = _LINE_HEADER.pack(
        b"GP", 0, LITTLE_ENDIAN | ENVELOPE_XY, srs_id, *envelope, 1, WKB_LINE_STRING, len(points)
    )
    return header + struct.pack(f"<{2 * len(points)}d", *(value for point in points for value in point))


def decoded_point(blob: bytes) -> tuple[float, float]:
    """The coordinates of a point geometry. Raises InputError for any other bytes."""
    if len(blob) == _POINT.size:
        magic, _, flags, _, _, kind, x, y = _POINT.unpack(blob)
        if magic == b"GP" and flags == LITTLE_ENDIAN and kind == WKB_POINT:
            return x, y
    points = decoded(blob)
    if len(points) != 1:
        raise InputError(f"a geometry has {len(points)} points: a landmark is one")
    return points[0]


def decoded(blob: bytes) -> Coordinates:
    """The points of a point or line geometry. Raises InputError for any other bytes."""
    try:
        return _decoded_wkb(blob, HEADER_SIZE + _envelope_size(blob))
    except (struct.error, IndexError) as error:
        raise InputError(f"a geometry of {len(blob)} bytes is cut short") from error


def _envelope_size(blob: bytes) -> int:
    if blob[:2] != b"GP":
        raise InputError(f"a geometry begins with {blob[:2]!r}, not with b'GP'")
    return ENVELOPE_SIZES[(blob[3] >> 1) & 0b111]


def _decoded_wkb(blob: bytes, start: int) -> Coordinates:
    order = "<" if blob[start] == 1 else ">"
    (kind,) = struct.unpack_from(f"{order}I", blob, start + 1)
    if kind == WKB_POINT:
        return (struct.unpack_from(f"{order}dd", blob, start + 5),)
    if kind == WKB_LINE_STRING:
        (count,) = struct.unpack_from(f"{order}I", blob, start + 5)
        flat = struct.unpack_from(f"{order}{2 * count}d", blob, start + 9)
        return tuple(zip(flat[::2], flat[1::2], strict=True))
    raise InputError(f"a geometry is of WKB type {kind}: only points (1) and lines (2) are kept here")


def min_x(blob: bytes) -> float:
    """The least x: what SQL knows as ST_MinX."""
    return _bounds(blob)[0]


def max_x(blob: bytes) -> float:
    """The greatest x: ST_MaxX."""
    return _bounds(blob)[1]


def min_y(blob: bytes) -> float:
    """The least y: ST_MinY."""
    return _bounds(blob)[2]


def max_y(blob: bytes) -> float:
    """The greatest y: ST_MaxY."""
    return _bounds(blob)[3]


@lru_cache(maxsize=16)  # a trigger asks four functions about one geometry
def _bounds(blob: bytes) -> tuple[float, float, float, float]:
    points = decoded(blob)
    x, y = [point[0] for point in points], [point[1] for point in points]
    return min(x), max(x), min(y), max(y)


def is_empty(blob: bytes) -> bool:
    """Whether the header says that a geometry has no point: ST_IsEmpty."""
    return bool(blob[3] & EMPTY)
