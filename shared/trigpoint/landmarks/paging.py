"""Answers in pages: each says its map version, and a token asks for the next one of the same version."""

import base64
import binascii
import hashlib
import json
from dataclasses import asdict, dataclass, replace

from trigpoint.errors import InputError
from trigpoint.landmarks.model import Landmark
from trigpoint.landmarks.ports import LandmarkStore
from trigpoint.landmarks.queries import LandmarkQuery, PageMark
from trigpoint.landmarks.selection import mark_of

TOKEN_BYTES_MOST = 2048
DIGEST_BYTES = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class LandmarkPage:
    """Landmarks of one map version (0: there is none yet); `next_page` is the token of the next page, "" at the end."""

    map_version: int
    landmarks: tuple[Landmark, ...]
    next_page: str


def page_of(store: LandmarkStore, query: LandmarkQuery, *, token: str = "") -> LandmarkPage:
    """The page a token asks for, of at most `query.limit` landmarks; without a token the first.

    Raises InputError as `LandmarkStore.landmarks`, and for a token that is none or belongs to another query.
    """
    asked = resumed(query, token) if token else query
    if asked.as_of is None:
        newest = store.newest_version()
        if newest is None:
            return LandmarkPage(map_version=0, landmarks=(), next_page="")
        asked = replace(asked, as_of=newest.map_version)
    one_more = replace(asked, limit=None if asked.limit is None else asked.limit + 1)
    return paged(store.landmarks(one_more), asked)


def paged(found: tuple[Landmark, ...], query: LandmarkQuery) -> LandmarkPage:
    """A page from the landmarks found for a query, one more than its limit if there are any; `as_of` is its version."""
    kept = found[: query.limit]
    token = next_page_token(query, mark_of(kept[-1], query)) if len(found) > len(kept) else ""
    return LandmarkPage(map_version=query.as_of or 0, landmarks=kept, next_page=token)


def next_page_token(query: LandmarkQuery, mark: PageMark) -> str:
    """The token of the page after a mark, of the query's version."""
    text = json.dumps([_digest(query), query.as_of, mark.landmark, mark.distance_m], ensure_ascii=False)
    return base64.urlsafe_b64encode(text.encode()).decode().rstrip("=")


def resumed(query: LandmarkQuery, token: str) -> LandmarkQuery:
    """The query for the page a token asks for.

    Raises InputError for a token that is none, that belongs to another query, or to another version than is asked for.
    """
    digest, as_of, mark = _read(token)
    if digest != _digest(query):
        raise InputError(f"page {token[:40]!r} belongs to another question: ask it as it was asked for the first page")
    if query.as_of not in (None, as_of):
        raise InputError(f"page {token[:40]!r} is of map version {as_of}: version {query.as_of} is asked for")
    if query.by_distance != (mark.distance_m is not None):
        raise InputError(f"page {token[:40]!r} is none: a distance is there if and only if one is asked for")
    return replace(query, as_of=as_of, after=mark)


def _read(token: str) -> tuple[str, int, PageMark]:
    refused = InputError(f"page {token[:40]!r} of {len(token)} characters is none: one is in the answer before it")
    if len(token) > TOKEN_BYTES_MOST:
        raise refused
    try:
        values = json.loads(base64.urlsafe_b64decode(token + "=" * (-len(token) % 4)))
    except (ValueError, binascii.Error, RecursionError) as error:
        raise refused from error
    match values:
        case [str(digest), int(as_of), str(landmark), None | float() as distance_m]:
            return digest, as_of, PageMark(landmark=landmark, distance_m=distance_m)
        case _:
            raise refused


def _digest(query: LandmarkQuery) -> str:
    """What tells a question from others: everything but version, page and its length."""
    said = asdict(replace(query, as_of=None, limit=None, after=None))
    return hashlib.blake2b(json.dumps(said).encode(), digest_size=DIGEST_BYTES).hexdigest()
