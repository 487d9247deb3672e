"""Points packed one behind the other in bytes, as sensors' drivers lay them out, read into the arrays of a sweep."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import EventRejected

Floats = NDArray[np.float64]

UNDECODABLE = "undecodable"
AXES = ("x", "y", "z")
INTENSITIES = ("reflectivity", "intensity")  # where both are there the first: it is corrected for range
RINGS = ("ring", "line", "laser_id")
# What drivers call a point's time, and its unit in ns: Velodyne "time", Ouster "t", Livox "offset_time".
UNIT_NS_OF: Mapping[str, float] = {"offset_ns": 1.0, "t": 1.0, "offset_time": 1.0, "time": 1e9, "time_offset": 1e9}
ABSOLUTE_TIME = "timestamp"  # since the Unix epoch: in s, as Hesai and RoboSense write it, or in ns, as Livox does
SECONDS_LIMIT = 1e12  # no time in s is as late, every time in ns since 1970-01-01T00:16:40Z is later
NS_PER_S = 1_000_000_000
STAMP_LIMIT_NS = 2**62  # the year 2116: differences stay within 64 bits
RING_LIMIT = np.iinfo(np.uint16).max
OFFSET_LOWEST_NS, OFFSET_HIGHEST_NS = float(np.iinfo(np.int32).min), float(np.iinfo(np.int32).max)
FIELDS_LIMIT, STRIDE_LIMIT = 64, 1024  # of a point, bytes: drivers use up to 10 fields and 48 bytes
KNOWN = frozenset((*AXES, *INTENSITIES, *RINGS, *UNIT_NS_OF, ABSOLUTE_TIME))


@dataclass(frozen=True, slots=True)
class PackedField:
    """One number of each point: its name, where it begins in the point, and its NumPy type, byte order included."""

    name: str
    offset: int
    dtype: "np.dtype[np.generic]"


@dataclass(frozen=True, slots=True, kw_only=True)
class PackedPoints:
    """The columns of n points, as in PointsScanned: `point_m` (n, 3), `intensity`, `offset_ns` and `ring` (n,)."""

    point_m: NDArray[np.float32]
    intensity: NDArray[np.float32]
    offset_ns: NDArray[np.int32]
    ring: NDArray[np.uint16]


def unpacked_points(
    fields: Sequence[PackedField], data: bytes, *, stride: int, stamp_ns: int | None = None
) -> PackedPoints:
    """The points of data that repeats the fields every `stride` bytes; intensity, offset and ring 0 where it has none.

    `stamp_ns` is the sweep's own, which times given since the Unix epoch are taken from. Raises EventRejected,
    "undecodable", where fields, stride and length do not fit, x, y or z is missing, or a value does not fit its column.
    """
    rows = _rows(fields, data, stride)
    point_m = np.empty((len(rows), 3), dtype=np.float32)
    with np.errstate(over="ignore", invalid="ignore"):  # what is too far for float32 is infinite: no return
        for index, axis in enumerate(AXES):
            point_m[:, index] = rows[axis]
        return PackedPoints(
            point_m=point_m,
            intensity=_intensity(rows),
            offset_ns=_offset_ns(rows, stamp_ns),
            ring=_ring(rows),
        )


def _rows(fields: Sequence[PackedField], data: bytes, stride: int) -> NDArray[np.void]:
    """The data as a structured array (n,)."""
    if len(fields) > FIELDS_LIMIT or not 1 <= stride <= STRIDE_LIMIT:
        raise EventRejected(
            UNDECODABLE,
            f"points of {len(fields)} fields and {stride} bytes: up to {FIELDS_LIMIT}, and 1 to {STRIDE_LIMIT}",
        )
    by_name = {field.name: field for field in fields}
    if len(by_name) < len(fields):
        listed = ", ".join(field.name for field in fields)
        raise EventRejected(UNDECODABLE, f"a field's name stands twice in {listed}")
    for axis in AXES:
        if axis not in by_name or by_name[axis].dtype.kind != "f":
            kind = by_name[axis].dtype if axis in by_name else "missing"
            raise EventRejected(UNDECODABLE, f"field {axis!r} is {kind}: float32 or float64 is needed")
    for field in fields:
        if not 0 <= field.offset <= stride - field.dtype.itemsize:
            raise EventRejected(
                UNDECODABLE,
                f"field {field.name!r} ends at byte {field.offset + field.dtype.itemsize} of a point of {stride} bytes",
            )
    if len(data) % stride:
        raise EventRejected(UNDECODABLE, f"{len(data)} bytes are no whole number of points of {stride} bytes")
    used = [field for field in fields if field.name in KNOWN]
    names, formats, offsets = [one.name for one in used], [one.dtype for one in used], [one.offset for one in used]
    layout = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": stride})
    return np.frombuffer(data, dtype=layout)


def _first_of(rows: NDArray[np.void], names: Sequence[str]) -> str | None:
    return next((name for name in names if name in (rows.dtype.names or ())), None)


def _intensity(rows: NDArray[np.void]) -> NDArray[np.float32]:
    name = _first_of(rows, INTENSITIES)
    if name is None:
        return np.zeros(len(rows), dtype=np.float32)
    return np.ascontiguousarray(rows[name], dtype=np.float32)


def _ring(rows: NDArray[np.void]) -> NDArray[np.uint16]:
    name = _first_of(rows, RINGS)
    if name is None:
        return np.zeros(len(rows), dtype=np.uint16)
    column = rows[name]
    wrong = ~((column >= 0) & (column <= RING_LIMIT))
    if wrong.any():
        raise EventRejected(UNDECODABLE, f"{name} {column[wrong][0]} is outside 0 to {RING_LIMIT}")
    return np.ascontiguousarray(column, dtype=np.uint16)


def _offset_ns(rows: NDArray[np.void], stamp_ns: int | None) -> NDArray[np.int32]:
    """When each point was measured, after the stamp; a point without a time of its own (NaN) at the stamp."""
    name = _first_of(rows, (*UNIT_NS_OF, ABSOLUTE_TIME))
    if name is None:
        return np.zeros(len(rows), dtype=np.int32)
    column = rows[name]
    if name == ABSOLUTE_TIME:
        offset_ns = _after_stamp_ns(column, stamp_ns)
    elif column.dtype.kind == "f":
        unit_ns = UNIT_NS_OF[name]
        offset_ns = np.rint(np.nan_to_num(column.astype(np.float64), nan=0.0) * unit_ns)
    else:
        offset_ns = column.astype(np.float64) * UNIT_NS_OF[name]  # exact: below 2**53, or outside the limit anyway
    wrong = ~((offset_ns >= OFFSET_LOWEST_NS) & (offset_ns <= OFFSET_HIGHEST_NS))
    if wrong.any():
        raise EventRejected(
            UNDECODABLE,
            f"{name}: a point {offset_ns[wrong][0] / NS_PER_S:.6g} s after the stamp, limit "
            f"{OFFSET_HIGHEST_NS / NS_PER_S:.3f} s",
        )
    return np.ascontiguousarray(offset_ns, dtype=np.int32)


def _after_stamp_ns(column: NDArray[np.generic], stamp_ns: int | None) -> Floats:
    if stamp_ns is None or not 0 <= stamp_ns < STAMP_LIMIT_NS:
        raise EventRejected(UNDECODABLE, f"{ABSOLUTE_TIME}: times since the epoch, and the cloud has stamp {stamp_ns}")
    given = column.astype(np.float64)
    if column.dtype.kind in "iu":
        after = (column.astype(np.int64) - stamp_ns).astype(np.float64)
    elif np.nanmax(given, initial=0.0) > SECONDS_LIMIT:
        after = given - stamp_ns
    else:
        after = (given - stamp_ns / NS_PER_S) * NS_PER_S
    return np.rint(np.nan_to_num(after, nan=0.0, posinf=np.inf, neginf=-np.inf))
