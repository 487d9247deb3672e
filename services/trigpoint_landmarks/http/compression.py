"""Content compressed for those who ask for it (RFC 9110, 8.4 and 12.5.3); nobody else waits for that."""

import asyncio
import gzip
import re

from starlette.responses import Response

GZIP = "gzip"
REFUSED = re.compile(r"\s*q\s*=\s*0(\.0*)?\s*")
VARY = "Accept-Encoding"
LEAST_BYTES = 1_000  # a smaller page fits into a packet as it is
PAGE_LEVEL = 1  # of a page, made for one asker; a sixth larger than at 6, in a third of the time
TILE_LEVEL = 6  # of a tile, which is kept
BLOCKING_BYTES = 65_536  # more than that is compressed in a thread


def accepts_gzip(accepted: str) -> bool:
    """Whether an Accept-Encoding asks for gzip."""
    weights = {name.strip(): weight for name, _, weight in (one.partition(";") for one in accepted.lower().split(","))}
    weight = weights.get(GZIP, weights.get("*"))
    return weight is not None and not REFUSED.fullmatch(weight)


async def compressed(content: bytes, level: int) -> bytes:
    """The content as gzip has it, the same bytes every time."""
    if len(content) < BLOCKING_BYTES:
        return gzip.compress(content, level, mtime=0)
    return await asyncio.to_thread(gzip.compress, content, level, mtime=0)


async def negotiated(page: Response, accepted: str) -> Response:
    """The page, which says that it varies by that, compressed where it is asked for and worth it."""
    if len(page.body) >= LEAST_BYTES and accepts_gzip(accepted):
        page.body = await compressed(bytes(page.body), PAGE_LEVEL)
        page.headers["Content-Encoding"] = GZIP
        page.headers["Content-Length"] = str(len(page.body))
    return page
