"""Landmarks in PostgreSQL's binary COPY form, many at once: numbers column by column, texts between them.

A row is the count of its fields, then of each field its length in bytes and its value; numbers are big-endian, the
geometry is EWKB as PostGIS takes it (PostgreSQL documentation, COPY, "Binary Format").
"""

from collections.abc import Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from trigpoint.landmarks.geopackage_geometry import WKB_POINT
from trigpoint.landmarks.landmark_record import COLUMNS
from trigpoint.landmarks.model import Landmark
from trigpoint.landmarks.postgis_geometry import HAS_SRID, POINT_BYTES
from trigpoint.landmarks.records import json_of_names

BEGINNING = b"PGCOPY\n\xff\r\n\0" + bytes(8)  # no flags, no extension
END = b"\xff\xff"
NULL_LENGTH = -1
LENGTH = ">i4"  # of a field, in bytes

REALS = COLUMNS[COLUMNS.index("x_m") : COLUMNS.index("observation_count")]
TO_LANDMARK = np.dtype(
    [
        ("fields", ">i2"),
        ("geom_length", LENGTH),
        ("order", "u1"),
        ("kind", "<u4"),
        ("srid", "<u4"),
        ("easting_m", "<f8"),
    ]
    + [("northing_m", "<f8"), ("length", LENGTH)]
)
TO_VEHICLES = np.dtype(
    [(name, kind) for real in REALS for name, kind in ((f"{real}_length", LENGTH), (real, ">f8"))]
    + [("count_length", LENGTH), ("observation_count", ">i8"), ("length", LENGTH)]
)
TO_ANCHORS = np.dtype(
    [("first_length", LENGTH), ("first_seen_ns", ">i8"), ("last_length", LENGTH), ("last_seen_ns", ">i8")]
    + [("anchored_length", LENGTH), ("anchored", "u1"), ("length", LENGTH)]
)
TO_END = np.dtype([("from_length", LENGTH), ("valid_from_version", ">i8"), ("to_length", LENGTH), ("to", ">i8")])
NULL_BYTES = TO_END["to"].itemsize  # at the end of a row that is still valid: a null has no value

Structured = NDArray[np.void]


def binary_rows(landmarks: Sequence[Landmark], *, srs_id: int) -> bytes:
    """The rows of at least one landmark, in order: all of `COLUMNS`."""
    columns = dict(zip(Landmark._fields, zip(*landmarks, strict=True), strict=True))
    names, kinds, signatures, provenances = (
        [text.encode() for text in columns[name]] for name in ("landmark", "kind", "signature", "provenance")
    )
    vehicles, anchors = ([json_of_names(one).encode() for one in columns[name]] for name in ("vehicles", "anchors"))
    parts = zip(
        _parts(_to_landmark(columns, _lengths(names), srs_id)),
        names,
        _parts(_lengths(kinds)),
        kinds,
        _parts(_lengths(signatures)),
        signatures,
        _parts(_to_vehicles(columns, _lengths(vehicles))),
        vehicles,
        _parts(_to_anchors(columns, _lengths(anchors))),
        anchors,
        _parts(_lengths(provenances)),
        provenances,
        _ends(columns),
        strict=True,
    )
    return b"".join(chain.from_iterable(parts))


Columns = dict[str, tuple[object, ...]]


def _to_landmark(columns: Columns, lengths: Structured, srs_id: int) -> Structured:
    part = np.empty(len(lengths), dtype=TO_LANDMARK)
    part["fields"], part["geom_length"], part["order"] = len(COLUMNS), POINT_BYTES, 1
    part["kind"], part["srid"], part["length"] = WKB_POINT | HAS_SRID, srs_id, lengths
    part["easting_m"], part["northing_m"] = columns["easting_m"], columns["northing_m"]
    return part


def _to_vehicles(columns: Columns, lengths: Structured) -> Structured:
    part = np.empty(len(lengths), dtype=TO_VEHICLES)
    for real in REALS:
        part[f"{real}_length"], part[real] = 8, columns[real]
    part["count_length"], part["observation_count"], part["length"] = 8, columns["observation_count"], lengths
    return part


def _to_anchors(columns: Columns, lengths: Structured) -> Structured:
    part = np.empty(len(lengths), dtype=TO_ANCHORS)
    part["first_length"], part["first_seen_ns"] = 8, columns["first_seen_ns"]
    part["last_length"], part["last_seen_ns"] = 8, columns["last_seen_ns"]
    part["anchored_length"], part["anchored"], part["length"] = 1, columns["anchored"], lengths
    return part


def _ends(columns: Columns) -> list[bytes]:
    versions = columns["valid_to_version"]
    part = np.empty(len(versions), dtype=TO_END)
    part["from_length"], part["valid_from_version"] = 8, columns["valid_from_version"]
    part["to_length"] = [NULL_LENGTH if version is None else 8 for version in versions]
    part["to"] = [version or 0 for version in versions]
    pairs = zip(_parts(part), versions, strict=True)
    return [whole[:-NULL_BYTES] if version is None else whole for whole, version in pairs]


def _lengths(texts: Sequence[bytes]) -> Structured:
    return np.fromiter(map(len, texts), dtype=LENGTH, count=len(texts))


def _parts(rows: Structured) -> list[bytes]:
    """The bytes of each element."""
    found: list[bytes] = rows.view(f"V{rows.dtype.itemsize}").tolist()
    return found
