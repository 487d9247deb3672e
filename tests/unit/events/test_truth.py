"""Truth survives its text form, and a broken line is named."""

import math

import numpy as np
import pytest

from trigpoint.errors import InputError
from trigpoint.events.truth import (
    Truth,
    TruthFixes,
    TruthLabel,
    TruthLandmark,
    TruthPath,
    truth_from_lines,
    truth_lines,
)

HEADER = "kind,name,stamp_ns,lat_deg,lon_deg,heading_rad,signature\n"
TRUTH = Truth(
    paths=(
        TruthPath(
            vehicle="car",
            stamp_ns=np.array([1_709_510_400_000_000_001, 1_709_510_400_100_000_000]),
            lat_deg=np.array([-33.88861234567, -33.8886]),
            lon_deg=np.array([151.18731234567, 151.1873]),
            heading_rad=np.array([0.5, math.nan]),
        ),
    ),
    landmarks=(TruthLandmark(landmark="pole-1", lat_deg=-33.5, lon_deg=151.5, signature="p1"),),
    labels=(TruthLabel(anchor="label-1", landmark="pole-1", lat_deg=-33.5, lon_deg=151.5),),
    fixes=(
        TruthFixes(
            vehicle="car",
            stamp_ns=np.array([1_709_510_400_000_000_000]),
            lat_deg=np.array([-33.25]),
            lon_deg=np.array([151.25]),
            state=("car park",),
        ),
    ),
)


def test_truth_comes_back_from_its_lines() -> None:
    again = truth_from_lines(truth_lines(TRUTH))
    assert (again.landmarks, again.labels) == (TRUTH.landmarks, TRUTH.labels)
    assert again.fixes[0].state == ("car park",)
    assert again.paths[0].stamp_ns.tolist() == TRUTH.paths[0].stamp_ns.tolist()
    assert again.paths[0].lat_deg.tolist() == TRUTH.paths[0].lat_deg.tolist()  # 11 decimals hold these
    assert math.isnan(again.paths[0].heading_rad[1])


@pytest.mark.parametrize("name", ["pole, big", 'the "old" one', "two\nlines"])
def test_a_name_that_csv_must_quote_comes_back(name: str) -> None:
    truth = Truth(landmarks=(TruthLandmark(landmark=name, lat_deg=-33.5, lon_deg=151.5, signature=name),))
    lines = "".join(truth_lines(truth)).splitlines(keepends=True)
    assert truth_from_lines(lines).landmarks == truth.landmarks


def test_a_broken_line_after_a_name_of_two_lines_is_refused_with_its_number() -> None:
    with pytest.raises(InputError, match="truth, line 4"):
        truth_from_lines([HEADER, '"pose","two\n', 'lines",1,2,3,4,\n', "pose,car,1,2\n"])


def test_a_path_is_sorted_by_time() -> None:
    lines = [HEADER, "pose,car,20,1,2,0,\n", "pose,car,10,3,4,0,\n"]
    assert truth_from_lines(lines).paths[0].stamp_ns.tolist() == [10, 20]


@pytest.mark.parametrize("line", ["pose,car,soon,1,2,0,\n", "pose,car,1,2\n", "pose,car,1,2,3,4,5,6\n"])
def test_a_broken_line_is_refused_with_its_number(line: str) -> None:
    with pytest.raises(InputError, match="truth, line 3"):
        truth_from_lines([HEADER, "pose,car,1,2,3,4,\n", line])


def test_an_unknown_kind_is_refused_by_name() -> None:
    with pytest.raises(InputError, match="kind 'guess' is none of pose"):
        truth_from_lines([HEADER, "guess,car,1,2,3,4,\n"])


def test_other_columns_are_refused() -> None:
    with pytest.raises(InputError, match="truth, line 1: the columns are 'time,x'"):
        truth_from_lines(["time,x\n"])
