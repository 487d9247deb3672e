"""Which keys may be published, and which of them an expression matches (Zenoh's key expressions)."""

import re
from functools import lru_cache

from trigpoint.errors import InputError

RESERVED = frozenset("*?#$")  # Zenoh gives these a meaning in expressions; a published name has none of them


def checked_key(key: str) -> str:
    """The key itself, if it may be published. Raises InputError for an empty chunk or a reserved character."""
    chunks = key.split("/")
    if not all(chunks):
        raise InputError(f"key {key!r} has an empty chunk: chunks between '/' hold at least one character")
    if any(chunk.startswith("@") for chunk in chunks):
        raise InputError(f"key {key!r} has a chunk that starts with '@': no wildcard would match it")
    if found := sorted(RESERVED.intersection(key)):
        raise InputError(f"key {key!r} holds {' '.join(found)!r}: none of '* ? # $' may be published")
    return key


def is_wild(expression: str) -> bool:
    """Whether an expression may match several keys."""
    return "*" in expression


def expressions_meet(one: str, other: str) -> bool:
    """Whether a key may match both of two expressions, at least one of them a key."""
    return key_matches(one, other) if is_wild(one) else key_matches(other, one)


def checked_expression(expression: str) -> str:
    """The expression itself, if each chunk is a name, `*` or `**`. Raises InputError otherwise."""
    for chunk in expression.split("/"):
        if not chunk or (chunk not in ("*", "**") and RESERVED.intersection(chunk)):
            raise InputError(f"key expression {expression!r}: chunk {chunk!r} is neither a name nor '*' nor '**'")
    if "**/**" in expression or "**/*/" in f"{expression}/":
        raise InputError(f"key expression {expression!r} is not canonical: write '*/**' for one chunk or more")
    return expression


@lru_cache(maxsize=1024)
def _pattern(expression: str) -> re.Pattern[str]:
    # Each chunk is matched with the "/" behind it, so that "a/**" matches "a" as well as "a/b/c".
    wild = {"*": "[^/]+/", "**": "(?:[^/]+/)*"}
    return re.compile("".join(wild.get(chunk) or re.escape(chunk) + "/" for chunk in expression.split("/")))


def key_matches(expression: str, key: str) -> bool:
    """Whether the expression matches the key: `*` is exactly one chunk, `**` any number of chunks, none included."""
    return _pattern(expression).fullmatch(f"{key}/") is not None
