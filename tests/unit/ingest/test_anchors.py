"""Anchors in any CRS become labels, or are refused with the reason."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from trigpoint.errors import FrameRefused
from trigpoint.geodesy.positions import Wgs84Position
from trigpoint.geodesy.projection import WGS84, pin_map_frame_at, transform_coordinates
from trigpoint_ingest.core.anchors import (
    FAR_LIMIT_M,
    IMAGE_SIGMA_M,
    LABEL_SIGMA_M,
    AnchorRow,
    distance_m,
    labelled,
    middle_of,
    near_map,
)

SYDNEY = Wgs84Position(-33.8886, 151.1946)
ROW = AnchorRow(anchor="p1", x=SYDNEY.lon_deg, y=SYDNEY.lat_deg, crs=WGS84, image="img-1", kind="pole")
FRAME = pin_map_frame_at(SYDNEY)


def test_a_position_in_wgs84_is_kept_to_the_bit() -> None:
    anchor = labelled([ROW]).anchors[0]
    assert (anchor.lat_deg, anchor.lon_deg) == (SYDNEY.lat_deg, SYDNEY.lon_deg)


@pytest.mark.parametrize("crs", ["EPSG:32756", "EPSG:3857", "EPSG:32755"])
def test_a_projected_position_comes_back_to_where_it_is(crs: str) -> None:
    x, y = transform_coordinates(np.array([ROW.x]), np.array([ROW.y]), source_crs=WGS84, target_crs=crs)
    anchor = labelled([replace(ROW, x=float(x[0]), y=float(y[0]), crs=crs)]).anchors[0]
    there = Wgs84Position(anchor.lat_deg, anchor.lon_deg)
    assert distance_m(SYDNEY, there) < 1e-3  # m: a zone away the projection's series still closes to a millimetre


def test_crs_and_operation_are_recorded() -> None:
    anchor = labelled([replace(ROW, x=333_000.0, y=6_248_500.0, crs="EPSG:28356")]).anchors[0]
    assert anchor.source_crs == "EPSG:28356"
    assert "GDA94 to WGS 84" in anchor.operation
    assert "accuracy" in anchor.operation


def test_an_image_label_without_sigmas_gets_the_defaults() -> None:
    anchor = labelled([ROW]).anchors[0]
    assert (anchor.sigma_m, anchor.image_sigma_m) == (LABEL_SIGMA_M, IMAGE_SIGMA_M)


@pytest.mark.parametrize("said", [{"image": "", "image_sigma_m": 0.5}, {"image": "survey", "image_sigma_m": 0.0}])
def test_a_survey_has_no_image_offset(said: dict[str, Any]) -> None:
    anchor = labelled([replace(ROW, sigma_m=0.02, **said)]).anchors[0]
    assert (anchor.sigma_m, anchor.image_sigma_m) == (0.02, 0.0)


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        (replace(ROW, x=math.nan), "not finite"),
        (replace(ROW, y=math.inf), "not finite"),
        (replace(ROW, y=91.0), "out of range"),
        (replace(ROW, x=181.0), "out of range"),
        (replace(ROW, x=1e12, y=1e12, crs="EPSG:32756"), "out of range"),
        (replace(ROW, sigma_m=0.0), "out of range"),
        (replace(ROW, sigma_m=-1.0), "out of range"),
        (replace(ROW, image_sigma_m=1000.0), "out of range"),
        (replace(ROW, anchor=""), "no name"),
        (replace(ROW, image="i" * 201), "out of range"),
    ],
)
def test_a_row_that_cannot_be_is_refused_and_the_others_go_on(row: AnchorRow, reason: str) -> None:
    found = labelled([row, replace(ROW, anchor="sound")])
    assert [refused.reason for refused in found.refused] == [reason]
    assert [anchor.anchor for anchor in found.anchors] == ["sound"]


def test_an_unknown_crs_refuses_the_whole_file() -> None:
    with pytest.raises(FrameRefused, match="EPSG:99999"):
        labelled([replace(ROW, crs="EPSG:99999")])


def test_a_crs_of_heights_refuses_the_whole_file() -> None:
    with pytest.raises(FrameRefused, match="geographic or projected"):
        labelled([replace(ROW, crs="EPSG:5773")])


def test_the_same_row_twice_counts_once() -> None:
    found = labelled([ROW, ROW])
    assert (len(found.anchors), len(found.refused)) == (1, 0)


def test_the_same_name_elsewhere_is_refused_with_the_distance() -> None:
    moved = replace(ROW, y=ROW.y + 1e-5)  # 1.109 m north at this latitude
    found = labelled([ROW, moved])
    assert found.anchors == labelled([ROW]).anchors
    assert found.refused[0].reason == "same anchor elsewhere"
    assert "1.109 m" in found.refused[0].detail


def test_the_same_name_in_another_image_is_another_label() -> None:
    assert len(labelled([ROW, replace(ROW, image="img-2", y=ROW.y + 1e-5)]).anchors) == 2


def test_the_wrong_hemisphere_is_refused_with_distance_and_limit() -> None:
    found = near_map(labelled([replace(ROW, y=-ROW.y)]).anchors, FRAME)
    assert found.refused[0].reason == "too far"
    assert "7,503.3 km" in found.refused[0].detail  # twice 33.8886 degrees of latitude, 110.7 km each
    assert "limit 100 km" in found.refused[0].detail


@pytest.mark.parametrize(("share", "count"), [(0.99, 1), (1.01, 0)])
def test_the_limit_is_where_it_says(share: float, count: int) -> None:
    degrees = share * FAR_LIMIT_M / 110_922.0  # m a degree of latitude at 33.9 degrees south
    origin_lat_deg = SYDNEY.lat_deg - 0.005  # the origin is rounded down to whole kilometres: 0.6 km off at most
    found = near_map(labelled([replace(ROW, y=origin_lat_deg + degrees)]).anchors, FRAME)
    assert len(found.anchors) == count


def test_the_middle_anchor_is_none_of_a_few_misplaced_ones() -> None:
    rows = [replace(ROW, anchor=str(index), y=ROW.y + index * 1e-5) for index in range(5)]
    rows += [replace(ROW, anchor=f"bad {index}", y=-ROW.y) for index in range(2)]
    assert middle_of(labelled(rows).anchors).lat_deg < 0.0
