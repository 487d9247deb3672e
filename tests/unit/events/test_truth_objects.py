"""Objects of a simulated world are read back as they were written."""

import math

import pytest

from trigpoint.errors import InputError
from trigpoint.events.truth_objects import COLUMNS, TruthObject, object_lines, objects_from_lines

POLE = TruthObject(
    kind="sign", name="pole-007", lat_deg=-33.89, lon_deg=151.18, ground_m=0.25, height_m=2.8, radius_m=0.11
)
CORNER = TruthObject(
    kind="corner", name="corner-001-b", lat_deg=-33.8, lon_deg=151.1, ground_m=-0.1, height_m=9.0, radius_m=math.nan
)


def test_objects_are_read_back_as_they_were_written() -> None:
    pole, corner = objects_from_lines(object_lines([POLE, CORNER]))
    assert pole == POLE
    assert (corner.name, corner.kind, math.isnan(corner.radius_m)) == ("corner-001-b", "corner", True)


def test_a_line_that_is_none_is_refused_with_its_number() -> None:
    with pytest.raises(InputError, match=r"objects, line 2: 'pole,x,1,2' is not kind,name"):
        objects_from_lines([",".join(COLUMNS) + "\n", "pole,x,1,2\n"])


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(InputError, match="kind 'house' is none of pole, sign, trunk, corner"):
        objects_from_lines([",".join(COLUMNS) + "\n", "house,x,1,2,3,4,5\n"])
