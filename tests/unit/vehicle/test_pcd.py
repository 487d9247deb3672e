"""Points of PCD files, as PCL writes them: as text, as bytes, and packed."""

import re

import numpy as np
import pytest

from trigpoint.errors import InputError
from trigpoint.events.packed_points import PackedPoints, unpacked_points
from trigpoint_vehicle.core.pcd import lzf_unpacked, pcd_points, pcd_viewpoint

HEADER = """# .PCD v0.7 - Point Cloud Data file format
VERSION 0.7
FIELDS x y z intensity ring
SIZE 4 4 4 4 2
TYPE F F F F U
COUNT 1 1 1 1 1
WIDTH 2
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS 2
DATA """
LAYOUT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u2")])
ROWS = np.array([(1.0, 2.0, 3.0, 10.0, 4), (np.nan, np.nan, np.nan, 0.0, 5)], dtype=LAYOUT)


def literal(data: bytes) -> bytes:
    """LZF that repeats nothing."""
    parts = [data[start : start + 32] for start in range(0, len(data), 32)]
    return b"".join(bytes([len(part) - 1]) + part for part in parts)


def lengths(packed: bytes, size: int) -> bytes:
    return len(packed).to_bytes(4, "little") + size.to_bytes(4, "little") + packed


def read(content: bytes) -> PackedPoints:
    packed = pcd_points("a.pcd", content)
    return unpacked_points(packed.fields, packed.data, stride=packed.stride)


def refused(content: bytes) -> str:
    with pytest.raises(InputError) as caught:
        pcd_points("a.pcd", content)
    return str(caught.value)


COLUMNS = b"".join(np.ascontiguousarray(ROWS[name]).tobytes() for name in LAYOUT.names or ())
BODIES = {
    "ascii": b"1 2 3 10 4\nnan nan nan 0 5\n",
    "binary": ROWS.tobytes(),
    "binary_compressed": lengths(literal(COLUMNS), len(COLUMNS)),
}


@pytest.mark.parametrize("kind", BODIES)
def test_points_are_the_same_however_they_are_written(kind: str) -> None:
    points = read(f"{HEADER}{kind}\n".encode() + BODIES[kind])
    assert points.point_m[0].tolist() == [1.0, 2.0, 3.0]
    assert np.isnan(points.point_m[1]).all()
    assert (points.intensity.tolist(), points.ring.tolist()) == ([10.0, 0.0], [4, 5])


def test_what_lzf_repeats_is_repeated_also_over_itself() -> None:
    # "ab", then 6 bytes from 2 back; then, of a long match (7 + 1 + 2), 10 bytes from 1 back
    packed = bytes([1, 97, 98, 4 << 5, 1, 7 << 5, 1, 0])
    assert lzf_unpacked(packed, 18) == b"abababab" + b"b" * 10


@pytest.mark.parametrize("packed", [bytes([4 << 5, 1]), bytes([0, 97]), bytes([7 << 5]), bytes([3, 97, 98, 99, 100])])
def test_damaged_lzf_is_refused(packed: bytes) -> None:
    with pytest.raises((ValueError, IndexError)):
        lzf_unpacked(packed, 3)


def test_fields_that_fill_up_or_hold_many_numbers_are_passed_over() -> None:
    layout = np.dtype([("x", "<f8"), ("_", "u1", (3,)), ("y", "<f8"), ("n", "<f4", (2,)), ("z", "<f8")])
    row = np.array([(1.0, (9, 9, 9), 2.0, (8.0, 8.0), 3.0)], dtype=layout)
    header = "FIELDS x _ y n z\nSIZE 8 1 8 4 8\nTYPE F U F F F\nCOUNT 1 3 1 2 1\nWIDTH 1\nHEIGHT 1\nDATA binary\n"
    assert read(header.encode() + row.tobytes()).point_m.tolist() == [[1.0, 2.0, 3.0]]


def test_text_that_is_no_pcd_file_is_refused() -> None:
    assert refused(b"ply\nformat ascii 1.0\n") == "a.pcd: no PCD file: no line DATA among the first 64"


def test_points_that_are_missing_are_counted() -> None:
    assert refused(f"{HEADER}binary\n".encode() + bytes(35)) == "a.pcd: 35 bytes of points, 36 were to come"


def test_lines_that_are_missing_are_counted() -> None:
    assert refused(f"{HEADER}ascii\n1 2 3 4 5\n".encode()) == "a.pcd: 1 lines of points, 2 were to come"


def test_a_line_with_too_few_numbers_is_refused() -> None:
    assert "lines that are not 5 numbers each" in refused(f"{HEADER}ascii\n1 2 3 4 5\n1 2 3\n".encode())


def test_data_of_an_unknown_kind_are_refused() -> None:
    assert "DATA 'zipped' is none of" in refused(f"{HEADER}zipped\n".encode())


def test_packed_points_of_another_length_are_refused() -> None:
    body = lengths(literal(COLUMNS), len(COLUMNS) + 1)
    assert "there are 38 and 36 to come" in refused(f"{HEADER}binary_compressed\n".encode() + body)


def test_damaged_packed_points_are_refused() -> None:
    body = lengths(bytes([255] * 4), len(COLUMNS))
    assert "compressed points are damaged" in refused(f"{HEADER}binary_compressed\n".encode() + body)


@pytest.mark.parametrize("wrong", ["SIZE 3 4 4 4 2", "TYPE Q F F F U", "COUNT 0 1 1 1 1", "POINTS many", "SIZE 4"])
def test_a_header_that_does_not_add_up_is_refused(wrong: str) -> None:
    assert "a header that says nothing of" in refused(f"{HEADER.replace('DATA ', wrong)}\nDATA binary\n".encode())


def test_a_header_that_asks_for_too_much_is_refused_before_anything_is_made() -> None:
    header = HEADER.replace("POINTS 2", "POINTS 99999999999")
    assert "99999999999 points of 18 bytes, limit 268435456 bytes in all" in refused(f"{header}ascii\n".encode())


def viewed_from(line: str) -> bytes:
    """A file with another line VIEWPOINT."""
    return f"{HEADER.replace('VIEWPOINT 0 0 0 1 0 0 0', line)}ascii\n".encode() + BODIES["ascii"]


def test_the_viewpoint_is_where_the_lidar_stands_and_how_it_is_turned_w_first() -> None:
    lidar = pcd_viewpoint("a.pcd", viewed_from("VIEWPOINT 1.2 -0.5 1.8 0.70711 0 0 0.70711"))
    assert lidar.position_m.tolist() == [1.2, -0.5, 1.8]
    assert lidar.orientation == pytest.approx([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)], abs=1e-12)  # made unit: rounding


@pytest.mark.parametrize(
    ("line", "why"),
    [
        (
            "VIEWPOINT 0 0 1 0.5 0 0 0.5",
            "'0 0 1 0.5 0 0 0.5' has a quaternion of length 0.707107, limit 1 within 0.001",
        ),
        ("VIEWPOINT 0 0 1 0 0 0 0", "a quaternion of length 0, limit 1 within 0.001"),
        ("VIEWPOINT 0 nan 1 1 0 0 0", "VIEWPOINT '0 nan 1 1 0 0 0' is not 7 finite numbers"),
        ("VIEWPOINT 0 0 1 1 0 0 inf", "is not 7 finite numbers"),
        ("VIEWPOINT 0 0 1", "VIEWPOINT '0 0 1' is not 7 finite numbers"),
        ("VIEWPOINT here", "VIEWPOINT 'here' is not 7 finite numbers"),
        ("", "VIEWPOINT '' is not 7 finite numbers"),
        ("VIEWPOINT 0 0 0 1 0 0 0", "says nothing of where the lidar is, nor does the manifest"),
    ],
)
def test_a_viewpoint_that_is_no_place_is_refused_with_what_it_says(line: str, why: str) -> None:
    with pytest.raises(InputError, match=f"^a.pcd: .*{re.escape(why)}"):
        pcd_viewpoint("a.pcd", viewed_from(line))
