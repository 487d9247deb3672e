"""Names people typed that nothing has: which ones were probably meant."""

from collections.abc import Iterable
from difflib import get_close_matches

NAMED_AT_MOST = 5  # in one message
ALIKE = 0.5  # of 1: two of four characters the same


def nearest_names(asked: str, there: Iterable[str]) -> str:
    """The names that are there, those most like the asked one first, a few of many: 'a', 'b' and 7 more; or none."""
    known = sorted(set(there))
    alike = get_close_matches(asked, known, n=NAMED_AT_MOST, cutoff=ALIKE)
    listed = [*alike, *(name for name in known if name not in alike)][:NAMED_AT_MOST]
    more = f" and {len(known) - len(listed)} more" if len(known) > len(listed) else ""
    return ", ".join(map(repr, listed)) + more if listed else "none"
