"""Key expressions match as Zenoh's do; Zenoh itself is the reference."""

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from trigpoint.bus.key_expressions import checked_expression, checked_key, key_matches
from trigpoint.errors import InputError

KEYS = st.lists(st.sampled_from(["a", "b", "obs", "v1", "a.b"]), min_size=1, max_size=5).map("/".join)
EXPRESSIONS = st.lists(st.sampled_from(["a", "b", "obs", "v1", "*", "**"]), min_size=1, max_size=5).map("/".join)


@given(expression=EXPRESSIONS, key=KEYS)
def test_an_accepted_expression_matches_what_zenoh_says_it_matches(expression: str, key: str) -> None:
    try:
        accepted = checked_expression(expression)
    except InputError:
        with pytest.raises(zenoh.ZError):
            zenoh.KeyExpr(expression)
        return
    assert key_matches(accepted, key) == zenoh.KeyExpr(accepted).intersects(zenoh.KeyExpr(key))


@pytest.mark.parametrize("key", ["t", "t/a", "t/a b/ü", "t/v1/veh/a-1/obs/gnss"])
def test_a_plain_key_may_be_published(key: str) -> None:
    assert checked_key(key) == key


def test_the_refusal_names_the_character() -> None:
    with pytest.raises(InputError, match=r"'\?'"):
        checked_key("t/a?")
