"""Tokens, how often one may ask, and what is kept in memory."""

import json
from pathlib import Path

import pytest

from command_runs.running import trigpoint
from trigpoint.errors import InputError
from trigpoint_landmarks.http.admission import KNOWN_LIMIT, Buckets
from trigpoint_landmarks.http.tile_cache import ENTRY_BYTES, TileCache
from trigpoint_landmarks.http.tokens import (
    Scope,
    TokenFile,
    Tokens,
    digest_of,
    issue_token,
    read_tokens,
    revoke_token,
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "tokens.json"


def test_a_secret_is_not_in_its_file(path: Path) -> None:
    _, secret = issue_token(path, "ann", Scope.LABEL, now_s=5)
    assert secret not in path.read_text(encoding="utf-8")
    assert read_tokens(path).of_secret(secret) == read_tokens(path).rows[0]


def test_the_file_is_for_its_owner_only(path: Path) -> None:
    issue_token(path, "ann", Scope.READ, now_s=5)
    assert path.stat().st_mode & 0o077 == 0


def test_a_name_has_one_token_in_force(path: Path) -> None:
    issue_token(path, "ann", Scope.READ, now_s=5)
    with pytest.raises(InputError, match="'ann' is in force"):
        issue_token(path, "ann", Scope.READ, now_s=6)
    revoke_token(path, "ann")
    issue_token(path, "ann", Scope.READ, now_s=7)
    assert [row.revoked for row in read_tokens(path).rows] == [True, False]


def test_revoking_an_unknown_token_names_those_there_are(path: Path) -> None:
    issue_token(path, "ann", Scope.READ, now_s=5)
    with pytest.raises(InputError, match="no token 'bob' is in force; there are ann"):
        revoke_token(path, "bob")


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"layout": "other", "tokens": []}', "[" * 100_000])
def test_a_file_that_holds_no_tokens_is_refused(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="cannot be read"):
        read_tokens(path)


def test_a_running_service_learns_of_changes(path: Path) -> None:
    _, secret = issue_token(path, "ann", Scope.READ, now_s=5)
    held = TokenFile(path, look_s=1.0)
    assert held.token_of(secret, now_s=10.0) is not None
    revoke_token(path, "ann")
    assert held.token_of(secret, now_s=10.5) is not None  # it was looked at half a second ago
    assert held.token_of(secret, now_s=11.0) is None


def test_no_text_but_the_secret_is_the_token() -> None:
    assert Tokens().of_secret("") is None
    assert digest_of("\ud800") != digest_of("")


def test_the_command_shows_a_secret_once(path: Path) -> None:
    issued = trigpoint("tokens", "issue", "ann", "--scope", "read", "--file", path, "--json").answer
    listed = trigpoint("tokens", "list", "--file", path, "--json")
    assert issued["token"] not in listed.out
    assert listed.answer["tokens"]["items"] == [
        {"name": "ann", "scope": "read", "issued_s": issued["issued_s"], "revoked": False}
    ]
    assert trigpoint("tokens", "revoke", "bob", "--file", path).status == 2
    assert trigpoint("tokens", "revoke", "ann", "--file", path).status == 0
    assert json.loads(path.read_text(encoding="utf-8"))["tokens"][0]["revoked"] is True


def test_a_scope_allows_those_before_it() -> None:
    allowed = [[one.allows(wanted) for wanted in Scope] for one in Scope]
    assert allowed == [[True, False, False], [True, True, False], [True, True, True]]


def test_a_bucket_empties_and_fills_again() -> None:
    buckets = Buckets(rate_hz=2.0, burst=2)
    assert [buckets.wait_s("a", now_s=0.0) for _ in range(3)] == [0.0, 0.0, 0.5]
    assert buckets.wait_s("b", now_s=0.0) == 0.0
    assert buckets.wait_s("a", now_s=0.5) == 0.0


def test_those_who_are_counted_are_bounded() -> None:
    buckets = Buckets(rate_hz=1.0, burst=1)
    waits = [buckets.wait_s(f"address {number}", now_s=0.0) for number in range(KNOWN_LIMIT + 10)]
    assert max(waits) == 0.0
    assert len(buckets._left) == KNOWN_LIMIT


def test_the_least_recently_asked_for_tile_is_dropped() -> None:
    cache = TileCache(limit_bytes=2 * (10 + ENTRY_BYTES))
    cache.put("a", b"0123456789")
    cache.put("b", b"0123456789")
    assert cache.get("a") is not None
    cache.put("c", b"0123456789")
    assert [cache.get(key) is not None for key in "abc"] == [True, False, True]
    assert cache.size_bytes == 2 * (10 + ENTRY_BYTES)


def test_a_tile_larger_than_all_that_may_be_kept_is_not() -> None:
    cache = TileCache(limit_bytes=1000)
    cache.put("a", b"x")
    cache.put("a", b"x" * 2000)
    assert (len(cache), cache.size_bytes) == (0, 0)
