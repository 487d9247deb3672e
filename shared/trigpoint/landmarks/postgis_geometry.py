"""PostGIS geometries as bytes (EWKB: WKB with the spatial reference's number), two dimensions only."""

import struct

from trigpoint.errors import InputError
from trigpoint.landmarks.geopackage_geometry import WKB_LINE_STRING, WKB_POINT, Coordinates

HAS_SRID = 0x20000000

_POINT = struct.Struct("<BIIdd")
POINT_BYTES = _POINT.size
_HEADER = struct.Struct("<BIII")


def encoded_point(x: float, y: float, *, srs_id: int) -> bytes:
    """A point."""
    return _POINT.pack(1, WKB_POINT | HAS_SRID, srs_id, x, y)


def encoded(points: Coordinates, *, srs_id: int) -> bytes:
    """One position as a point, several as a line. Raises InputError for none."""
    if not points:
        raise InputError("a geometry of no points: 1 is the least")
    if len(points) == 1:
        return encoded_point(*points[0], srs_id=srs_id)
    header = _HEADER.pack(1, WKB_LINE_STRING | HAS_SRID, srs_id, len(points))
    return header + struct.pack(f"<{2 * len(points)}d", *(value for point in points for value in point))


def decoded(blob: bytes) -> tuple[int, Coordinates]:
    """The number of the spatial reference and the points of a point or line. Raises InputError for any other bytes."""
    try:
        order = "<" if blob[0] == 1 else ">"
        kind, srs_id = struct.unpack_from(f"{order}II", blob, 1)
        if kind == WKB_POINT | HAS_SRID:
            return srs_id, (struct.unpack_from(f"{order}dd", blob, 9),)
        if kind == WKB_LINE_STRING | HAS_SRID:
            (count,) = struct.unpack_from(f"{order}I", blob, 9)
            flat = struct.unpack_from(f"{order}{2 * count}d", blob, 13)
            return srs_id, tuple(zip(flat[::2], flat[1::2], strict=True))
    except (struct.error, IndexError) as error:
        raise InputError(f"a geometry of {len(blob)} bytes is cut short") from error
    raise InputError(f"a geometry is of EWKB type {kind:#x}: only points and lines with a reference are kept here")
