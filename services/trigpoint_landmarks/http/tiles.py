"""Vector tiles over HTTP: kept in memory by version, named by strong ETags, empty ones without content."""

import asyncio
import re
from dataclasses import dataclass
from http import HTTPStatus

from starlette.responses import Response

from trigpoint.errors import InputError
from trigpoint.geodesy.web_tiles import WebTile
from trigpoint.landmarks.feature_query import FeatureSource, MapState
from trigpoint.landmarks.layers import LAYERS, Layer
from trigpoint.landmarks.tile_grid import require_tile
from trigpoint.observability.metrics import Instruments
from trigpoint_landmarks.http.asked import Asked
from trigpoint_landmarks.http.compression import GZIP, TILE_LEVEL, VARY, compressed
from trigpoint_landmarks.http.documents import MVT
from trigpoint_landmarks.http.map_watch import MapWatch
from trigpoint_landmarks.http.problems import Problem
from trigpoint_landmarks.http.tile_cache import TileCache

DRAWING = 1  # of this kind: another way to draw tiles gets another number, and other ETags
YEAR_S = 31_536_000
FRESH_S = 1  # how long a tile of whatever version is newest may be shown unasked
WHOLE = re.compile(r"0|[1-9][0-9]{0,9}")
IN_GZIP = "-gzip"  # at the end of an ETag: a strong one names bytes, which differ by encoding
NAMES = ("as_of", "version", "f")

TileKey = tuple[str, WebTile, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Held:
    """What a client holds, by its If-None-Match, and whether it takes tiles in gzip."""

    etag: str = ""
    in_gzip: bool = False


class Tiles:
    """Tiles from a source, of the version a watch knows, each drawn once for all who ask for it at the same time."""

    def __init__(
        self, source: FeatureSource, watch: MapWatch, *, cache_bytes: int, public: bool, instruments: Instruments
    ) -> None:
        self._source, self._watch = source, watch
        self._hits, self._misses = instruments.tile_cache_hits, instruments.tile_cache_misses
        self._cache = TileCache(limit_bytes=cache_bytes)
        self._drawing: dict[TileKey, asyncio.Task[bytes]] = {}
        self._audience = "public" if public else "private"

    async def tile(self, asked: Asked, layer: Layer, tile: WebTile, *, as_of: int | None, held: Held) -> Response:
        """A tile, named anew by its ETag in each encoding. Raises Problem, DatabaseUnavailable."""
        state = await self._watch.current()
        if state is None:
            return Response(None, HTTPStatus.NO_CONTENT, {"Cache-Control": "no-cache"})
        state = await self._watch.version(as_of, state)
        version = state.newest if as_of is None else as_of
        own = (
            f'"{DRAWING}-{layer.name}-{tile.zoom}-{tile.column}-{tile.row}-{version}{IN_GZIP if held.in_gzip else ""}"'
        )
        kept = f"max-age={YEAR_S}, immutable" if as_of is not None else f"max-age={FRESH_S}, must-revalidate"
        headers = {"ETag": own, "Cache-Control": f"{self._audience}, {kept}", "Vary": VARY}
        if held.etag and _matches(held.etag, own):
            return Response(None, HTTPStatus.NOT_MODIFIED, headers)
        content = await self._content((layer.name, tile, version), layer, state)
        if not content:
            return Response(None, HTTPStatus.NO_CONTENT, headers)
        if held.in_gzip:
            content = await self._in_gzip((layer.name, tile, version), content)
            headers["Content-Encoding"] = GZIP
        return Response(content, HTTPStatus.OK, headers, MVT)

    async def _in_gzip(self, key: TileKey, content: bytes) -> bytes:
        """A tile's content compressed, kept beside it."""
        held = self._cache.get((*key, GZIP))
        if held is None:
            held = await compressed(content, TILE_LEVEL)
            self._cache.put((*key, GZIP), held)
        return held

    async def _content(self, key: TileKey, layer: Layer, state: MapState) -> bytes:
        held = self._cache.get(key)
        if held is not None:
            self._hits.inc()
            return held
        drawing = self._drawing.get(key)
        if drawing is None:
            self._misses.inc()
            drawing = asyncio.create_task(self._drawn(key, layer, state))
            self._drawing[key] = drawing
            drawing.add_done_callback(lambda _: self._drawing.pop(key, None))
        return await asyncio.shield(drawing)

    async def _drawn(self, key: TileKey, layer: Layer, state: MapState) -> bytes:
        _, tile, version = key
        content = await self._source.tile(layer, tile, state, as_of=version)
        self._cache.put(key, content)
        return content


def tile_of(zoom: str, column: str, row: str) -> WebTile:
    """The tile of three numbers as they stand in a path. Raises Problem where there is none."""
    if not all(map(WHOLE.fullmatch, (zoom, column, row))):
        raise Problem(HTTPStatus.NOT_FOUND, "a tile's zoom, column and row are whole numbers")
    try:
        return require_tile(int(zoom), int(column), int(row))
    except InputError as error:
        raise Problem(HTTPStatus.NOT_FOUND, str(error)) from error


def tiled_layer(name: str) -> Layer:
    """The layer of a name. Raises Problem where there are no tiles of one."""
    layer = LAYERS.get(name)
    if layer is None or not layer.tiled:
        there = ", ".join(one.name for one in LAYERS.values() if one.tiled)
        raise Problem(HTTPStatus.NOT_FOUND, f"no tiles of {name[:40]!r}: there are those of {there}")
    return layer


def asked_version(asked: Asked) -> int | None:
    """The version of `as_of` or `version`, which mean the same. Raises InputError for both."""
    asked.require_only(NAMES)
    if "as_of" in asked.parameters and "version" in asked.parameters:
        raise InputError("as_of and version mean the same: one of them is enough")
    return asked.whole("as_of") if "as_of" in asked.parameters else asked.whole("version")


def _matches(given: str, own: str) -> bool:
    """Whether an If-None-Match names an ETag, weakly compared (RFC 9110, 13.1.2)."""
    return given.strip() == "*" or own in {one.strip().removeprefix("W/") for one in given.split(",")}
