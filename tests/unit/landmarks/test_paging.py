"""Tokens of pages: whose they are, and what is none."""

import base64
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trigpoint.errors import InputError
from trigpoint.landmarks.paging import next_page_token, resumed
from trigpoint.landmarks.queries import LandmarkQuery, Nearest, PageMark, TimeSpan

QUERY = LandmarkQuery(kinds=("pole",), as_of=3, limit=10)
TOKEN = next_page_token(QUERY, PageMark(landmark="L7"))


def token_of(values: object) -> str:
    return base64.urlsafe_b64encode(json.dumps(values).encode()).decode()


def test_a_token_goes_on_after_its_mark_in_its_version() -> None:
    found = resumed(LandmarkQuery(kinds=("pole",), limit=25), TOKEN)
    assert found == LandmarkQuery(kinds=("pole",), as_of=3, limit=25, after=PageMark(landmark="L7"))


def test_a_token_of_another_question_is_refused() -> None:
    with pytest.raises(InputError, match="belongs to another question"):
        resumed(LandmarkQuery(kinds=("corner",)), TOKEN)


def test_a_token_of_another_version_is_refused_with_both() -> None:
    with pytest.raises(InputError, match="is of map version 3: version 4 is asked for"):
        resumed(LandmarkQuery(kinds=("pole",), as_of=4), TOKEN)


@pytest.mark.parametrize(
    "values", [7, [], ["x", 1, "L1"], ["x", 1, "L1", "far"], ["x", 1.5, "L1", None], {"a": 1}, ["x", 1, 5, None]]
)
def test_a_token_of_another_form_is_refused(values: object) -> None:
    with pytest.raises(InputError, match="is none"):
        resumed(QUERY, token_of(values))


@given(text=st.text(max_size=200))
def test_no_text_is_taken_for_a_token_that_is_none(text: str) -> None:
    with pytest.raises(InputError):
        resumed(QUERY, text)


def test_a_token_too_long_is_refused() -> None:
    with pytest.raises(InputError, match="of 5000 characters is none"):
        resumed(QUERY, "A" * 5000)


@pytest.mark.parametrize(
    ("asked", "reason"),
    [
        ({"max_sigma_m": 0.0}, "max_sigma_m 0.0 is outside 0 to 1e"),
        ({"max_sigma_m": float("nan")}, "max_sigma_m nan is outside"),
        ({"vehicle": ""}, "vehicle has 0 characters"),
        ({"vehicle": "a\0"}, "holds a character that no database keeps"),
        ({"vehicle": "\ud800"}, "holds a character that no database keeps"),
        ({"kinds": ("x",) * 65}, "65 kinds are asked for: at most 64"),
        ({"as_of": 2**63}, "as_of 9223372036854775808 is outside"),
    ],
)
def test_a_condition_outside_its_limits_is_refused_with_them(asked: dict[str, object], reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        LandmarkQuery(**asked)  # type: ignore[arg-type]


@pytest.mark.parametrize("count", [0, -1, 10_001])
def test_a_number_of_the_nearest_outside_its_limits_is_refused(count: int) -> None:
    with pytest.raises(InputError, match=f"nearest {count} is outside 1 to 10000"):
        Nearest(lat_deg=0.0, lon_deg=0.0, count=count)


def test_a_time_span_that_is_inverted_is_refused() -> None:
    with pytest.raises(InputError, match="first_ns 5 is after last_ns 4"):
        TimeSpan(first_ns=5, last_ns=4)
