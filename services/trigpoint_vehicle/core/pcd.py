"""Point Cloud Data files (PCL's .pcd, version 0.7): ascii, binary and binary_compressed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.events.packed_points import PackedField
from trigpoint_vehicle.core.mountings import AT_BASE, Mounting

HEADER_LINES, HEADER_BYTES = 64, 16_384  # no header is longer
NUMBER_KINDS = {"F": "f", "I": "i", "U": "u"}
NUMBER_SIZES = {"F": (4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}
SCAN_LIMIT_BYTES = 256 * 1024 * 1024  # unpacked: what a header may make us allocate
VIEWPOINT_NUMBERS = 7  # x, y, z in m, then a quaternion w, x, y, z
UNIT_TOLERANCE = 1e-3  # of the quaternion's length: written with three decimals it is off by up to that
LZF_LITERALS = 32  # a control byte below begins so many bytes and one more


@dataclass(frozen=True, slots=True, kw_only=True)
class PcdPoints:
    """Points one behind the other, as `unpacked_points` takes them."""

    fields: tuple[PackedField, ...]
    stride: int
    data: bytes


def pcd_points(name: str, content: bytes) -> PcdPoints:
    """The points of a file. Raises InputError naming the file and what of it is wrong."""
    header, begin = _header(name, content)
    try:
        layout = _layout(header)
        count = int(header["POINTS"][0]) if "POINTS" in header else int(header["WIDTH"][0]) * int(header["HEIGHT"][0])
    except (KeyError, ValueError, IndexError) as error:
        raise InputError(f"{name}: a header that says nothing of {error}") from None
    size = count * layout.itemsize
    if not 0 <= size <= SCAN_LIMIT_BYTES:
        raise InputError(f"{name}: {count} points of {layout.itemsize} bytes, limit {SCAN_LIMIT_BYTES} bytes in all")
    body, kind = content[begin:], " ".join(header["DATA"])
    if kind == "binary":
        data = _required(name, body, size)
    elif kind == "ascii":
        data = _text_points(name, body, layout, count)
    elif kind == "binary_compressed":
        data = _column_points(_required(name, _unpacked(name, body, size), size), layout, count)
    else:
        raise InputError(f"{name}: DATA {kind!r} is none of ascii, binary, binary_compressed")
    fields = tuple(PackedField(field, offset, one) for field, (one, offset) in _scalars(layout))
    return PcdPoints(fields=fields, stride=layout.itemsize, data=data)


def pcd_viewpoint(name: str, content: bytes) -> Mounting:
    """Where the lidar stood, turned how, as the line VIEWPOINT of a file says: `T_a_sensor`, and the points are in the
    sensor's frame (as PCL's pcl_transform_from_viewpoint takes it).

    Raises InputError naming the file where the line is missing, is what writers put for a place they do not know (0 0 0
    1 0 0 0), or holds what is no place or no unit quaternion.
    """
    header, _ = _header(name, content)
    words = header.get("VIEWPOINT", [])
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError:
        numbers = np.array([np.nan])
    if len(numbers) != VIEWPOINT_NUMBERS or not np.isfinite(numbers).all():
        raise InputError(f"{name}: VIEWPOINT {' '.join(words)!r} is not {VIEWPOINT_NUMBERS} finite numbers")
    position_m, orientation = numbers[:3], np.roll(numbers[3:], -1)
    length = float(np.linalg.norm(orientation))
    if not abs(length - 1.0) <= UNIT_TOLERANCE:
        said = f"VIEWPOINT {' '.join(words)!r} has a quaternion of length {length:.6g}"
        raise InputError(f"{name}: {said}, limit 1 within {UNIT_TOLERANCE:g}")
    if not position_m.any() and np.array_equal(np.abs(orientation), AT_BASE.orientation):
        raise InputError(
            f"{name}: VIEWPOINT {' '.join(words)!r} says nothing of where the lidar is, nor does the manifest"
        )
    return Mounting(position_m, orientation / length)


def _header(name: str, content: bytes) -> tuple[dict[str, list[str]], int]:
    """The header's words by their first, and where the data begin."""
    header: dict[str, list[str]] = {}
    begin = 0
    for _ in range(HEADER_LINES):
        end = content.find(b"\n", begin, begin + HEADER_BYTES)
        if end < 0:
            break
        words = content[begin:end].decode("ascii", "replace").split()
        begin = end + 1
        if words and not words[0].startswith("#"):
            header[words[0]] = words[1:]
        if "DATA" in header:
            return header, begin
    raise InputError(f"{name}: no PCD file: no line DATA among the first {HEADER_LINES}")


def _layout(header: dict[str, list[str]]) -> "np.dtype[np.void]":
    """The point as it stands in the file. Raises KeyError, ValueError or IndexError for an unknown number."""
    names, sizes, kinds = header["FIELDS"], [int(size) for size in header["SIZE"]], header["TYPE"]
    counts = [int(count) for count in header.get("COUNT", ["1"] * len(names))]
    columns = []
    for index, (name, size, kind, count) in enumerate(zip(names, sizes, kinds, counts, strict=True)):
        if size not in NUMBER_SIZES[kind] or count < 1:
            raise ValueError(f"{count} numbers {kind}{size} for field {name!r}")
        columns.append((f"{index} {name}", f"<{NUMBER_KINDS[kind]}{size}", (count,)))
    return np.dtype(columns)


def _scalars(layout: "np.dtype[np.void]") -> list[tuple[str, tuple["np.dtype[np.generic]", int]]]:
    """The fields of one number, by name; `_` fills up and stands for nothing."""
    found = []
    for numbered, entry in (layout.fields or {}).items():
        name, (one, shape) = str(numbered).split(" ", 1)[1], entry[0].subdtype or (entry[0], ())
        if name != "_" and shape in ((), (1,)):
            found.append((name, (one, int(entry[1]))))
    return found


def _required(name: str, data: bytes, size: int) -> bytes:
    if len(data) < size:
        raise InputError(f"{name}: {len(data)} bytes of points, {size} were to come")
    return data[:size]


def _text_points(name: str, body: bytes, layout: "np.dtype[np.void]", count: int) -> bytes:
    lines = [line.split() for line in body.decode("ascii", "replace").splitlines() if line.strip()]
    if len(lines) < count:
        raise InputError(f"{name}: {len(lines)} lines of points, {count} were to come")
    width = sum(_width(entry) for entry in (layout.fields or {}).values())
    rows = np.empty(count, dtype=layout)
    try:
        numbers = np.array(lines[:count], dtype=np.float64).reshape(count, width)
        at = 0
        for numbered, entry in (layout.fields or {}).items():
            rows[numbered] = numbers[:, at : at + _width(entry)].astype((entry[0].subdtype or (entry[0],))[0])
            at += _width(entry)
    except ValueError as error:
        raise InputError(f"{name}: lines that are not {width} numbers each: {error}") from None
    return rows.tobytes()


def _width(entry: Sequence[object]) -> int:
    kind = entry[0]
    assert isinstance(kind, np.dtype)
    return int(np.prod(kind.shape))


def _column_points(data: bytes, layout: "np.dtype[np.void]", count: int) -> bytes:
    """Points from columns that stand one behind the other."""
    rows: NDArray[np.void] = np.empty(count, dtype=layout)
    at = 0
    for numbered, entry in (layout.fields or {}).items():
        one = (entry[0].subdtype or (entry[0],))[0]
        column = np.frombuffer(data, dtype=one, count=count * _width(entry), offset=at)
        rows[numbered] = column.reshape(count, _width(entry))
        at += column.nbytes
    return rows.tobytes()


def _unpacked(name: str, body: bytes, size: int) -> bytes:
    """The data behind their two lengths, decompressed."""
    if len(body) < 8:
        raise InputError(f"{name}: {len(body)} bytes of compressed points, their lengths alone take 8")
    packed, whole = (int.from_bytes(body[at : at + 4], "little") for at in (0, 4))
    if whole != size or len(body) - 8 < packed:
        raise InputError(f"{name}: {packed} bytes packed of {whole}, there are {len(body) - 8} and {size} to come")
    try:
        return lzf_unpacked(body[8 : 8 + packed], whole)
    except (IndexError, ValueError) as error:
        raise InputError(f"{name}: compressed points are damaged: {error}") from None


def lzf_unpacked(packed: bytes, size: int) -> bytes:
    """What LZF (Lehmann, LibLZF) packed, at most `size` bytes. Raises IndexError or ValueError for what it did not."""
    out = bytearray()
    at = 0
    while at < len(packed) and len(out) <= size:
        control, at = packed[at], at + 1
        if control < LZF_LITERALS:
            out += packed[at : at + control + 1]
            at += control + 1
            continue
        length = control >> 5
        if length == 7:
            length, at = length + packed[at], at + 1
        back, at = ((control & 0x1F) << 8 | packed[at]) + 1, at + 1
        start, length = len(out) - back, length + 2
        if start < 0:
            raise ValueError(f"byte {len(out)} repeats what stands {back} bytes before it")
        repeated = out[start : start + length]
        out += repeated * (length // len(repeated)) + repeated[: length % len(repeated)]
    if len(out) != size:
        raise ValueError(f"{len(out)} bytes, {size} were to come")
    return bytes(out)
