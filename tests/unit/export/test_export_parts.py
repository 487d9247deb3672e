"""The parts of an export: epochs, CRS, cells and texts."""

import csv
import io
from datetime import UTC, datetime

import pytest

from landmark_maps.examples import version_row
from trigpoint.errors import FrameRefused, InputError
from trigpoint.geodesy.projection import crs_unit, needs_epoch
from trigpoint.landmarks.feature_crs import CRS84
from trigpoint.landmarks.queries import TimeSpan
from trigpoint.landmarks.xml_text import xml_text
from trigpoint_landmarks.export.colours import PALETTE, colour_of
from trigpoint_landmarks.export.csv_file import cell_text
from trigpoint_landmarks.export.placed import crs_of
from trigpoint_landmarks.export.provenance import decimal_year, provenance_of

NS_PER_S = 1_000_000_000


def ns(*date: int) -> int:
    return int(datetime(*date, tzinfo=UTC).timestamp()) * NS_PER_S  # type: ignore[misc,arg-type]  # year, month, day


@pytest.mark.parametrize(
    ("stamp_ns", "year"),
    [(0, 1970.0), (ns(2024, 7, 2), 2024.5), (ns(2023, 12, 31), 2023.997), (ns(2025, 1, 1), 2025.0)],
)
def test_a_decimal_year_knows_leap_years(stamp_ns: int, year: float) -> None:
    assert decimal_year(stamp_ns) == pytest.approx(year, abs=1e-3)


@pytest.mark.parametrize(
    ("crs", "moves"), [("EPSG:4326", True), ("EPSG:32756", True), ("EPSG:7856", False), ("EPSG:25832", False)]
)
def test_the_ground_moves_in_a_frame_that_no_plate_carries(crs: str, moves: bool) -> None:
    assert needs_epoch(crs) is moves


@pytest.mark.parametrize("map_crs", ["EPSG:32756", "EPSG:7856"])
def test_an_epoch_is_given_where_the_map_s_own_ground_moves(map_crs: str) -> None:
    seen = TimeSpan(first_ns=ns(2024, 1, 1), last_ns=ns(2025, 1, 1))
    found = provenance_of(version_row(crs=map_crs), CRS84, seen, generator="test")
    assert found.coordinate_epoch == (2024.5 if map_crs == "EPSG:32756" else None)
    assert found.operation_accuracy_m is None  # not known


def test_degrees_are_always_longitude_first() -> None:
    assert crs_of("epsg:4326") == crs_of("OGC:CRS84") == CRS84
    assert not crs_of("EPSG:7844").north_first


@pytest.mark.parametrize("text", ["", "32756", "EPSG:", "EPSG:1e3", "EPSG:32756; DROP", "PROJ:utm"])
def test_another_text_is_no_crs(text: str) -> None:
    with pytest.raises(InputError, match="is not EPSG:<code>"):
        crs_of(text)


@pytest.mark.parametrize("crs", ["EPSG:2263", "EPSG:4978"])
def test_feet_and_geocentric_metres_are_refused(crs: str) -> None:
    with pytest.raises(FrameRefused, match="degrees or metres are needed"):
        crs_unit(crs)


@pytest.mark.parametrize("text", ["=1+1", "'=1", "'", "+", "\rx", 'a "b"', "a,b\r\nc", "", "plain"])
def test_a_text_comes_back_from_its_cell(text: str) -> None:
    (row,) = csv.reader(io.StringIO(cell_text(text), newline=""))
    assert not row[0].startswith(("=", "+", "-", "@", "\t", "\r", "\n"))
    assert row[0].removeprefix("'") == text


@pytest.mark.parametrize(("cell", "text"), [(None, ""), (True, "true"), (-1.5, "-1.5"), (2**62, str(2**62))])
def test_no_text_is_as_it_is(cell: float | bool | None, text: str) -> None:
    assert cell_text(cell) == text


def test_what_no_xml_holds_is_replaced() -> None:
    assert xml_text("a\x00b\x1fc\tä\n🜨") == "a\N{REPLACEMENT CHARACTER}b\N{REPLACEMENT CHARACTER}c\tä\n🜨"


def test_a_kind_has_the_same_colour_in_every_run() -> None:
    assert colour_of("pole") == PALETTE[0]
    assert colour_of("manhole") == colour_of("manhole")
