"""Landmarks in the server's binary form: field by field the record that every database keeps."""

import struct
from collections.abc import Iterator

from landmark_maps.examples import landmark
from trigpoint.landmarks.landmark_record import COLUMNS, record_of
from trigpoint.landmarks.postgis_geometry import encoded_point
from trigpoint.landmarks.postgis_rows import binary_rows

SRS_ID = 32756
MARK = landmark("Pfahl 7/ü", 12.345678901234567, -0.1)
ROWS = [
    MARK,
    MARK.until(9),
    MARK._replace(landmark="", vehicles=(), anchors=(), anchored=False, provenance="{}", observation_count=-1),
]


def rows_of(data: bytes) -> Iterator[list[bytes | None]]:
    """The values of each row, None for null."""
    offset = 0
    while offset < len(data):
        (count,) = struct.unpack_from(">h", data, offset)
        offset, values = offset + 2, list[bytes | None]()
        for _ in range(count):
            (length,) = struct.unpack_from(">i", data, offset)
            offset += 4
            values.append(None if length < 0 else data[offset : offset + length])
            offset += max(length, 0)
        yield values


def as_bytes(value: object) -> bytes | None:
    """A value as PostgreSQL's binary form has it."""
    if isinstance(value, bool):
        return bytes([value])
    if isinstance(value, int):
        return struct.pack(">q", value)
    if isinstance(value, float):
        return struct.pack(">d", value)
    return value.encode() if isinstance(value, str) else value if isinstance(value, bytes) else None


def test_every_field_is_that_of_the_record() -> None:
    records = [record_of(row, encoded_point(row.easting_m, row.northing_m, srs_id=SRS_ID)) for row in ROWS]
    assert list(rows_of(binary_rows(ROWS, srs_id=SRS_ID))) == [list(map(as_bytes, record)) for record in records]


def test_a_row_has_a_field_for_every_column() -> None:
    assert [len(row) for row in rows_of(binary_rows(ROWS, srs_id=SRS_ID))] == [len(COLUMNS)] * len(ROWS)
