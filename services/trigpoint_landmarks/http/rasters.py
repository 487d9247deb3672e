"""Pictures of the ground as tiles: folders of XYZ tiles that were named in the settings, and nothing beside them."""

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import blake2b
from http import HTTPStatus

from starlette.responses import Response

from trigpoint.geodesy.web_tiles import WebTile
from trigpoint_landmarks.http.documents import JsonObject
from trigpoint_landmarks.http.problems import Problem
from trigpoint_landmarks.http.settings import RasterSettings

PICTURES = {"png": "image/png", "jpg": "image/jpeg", "webp": "image/webp"}
TILE_MOST_BYTES = 4 * 1024 * 1024
KEPT = "private, max-age=60"
TILE_SIZE = 256


@dataclass(frozen=True, slots=True)
class Rasters:
    """The pictures there are, by name."""

    by_name: Mapping[str, RasterSettings]

    def document(self) -> JsonObject:
        """What is said of them."""
        return {"rasters": [_described(one) for one in self.by_name.values()]}

    async def tile(self, name: str, tile: WebTile, ending: str, *, etag: str) -> Response:
        """A picture's tile. Raises Problem where there is none."""
        raster = self.by_name.get(name)
        if raster is None:
            there = ", ".join(self.by_name) or "none"
            raise Problem(HTTPStatus.NOT_FOUND, f"no raster {name[:40]!r}: there are {there}")
        if ending != raster.ending:
            raise Problem(HTTPStatus.NOT_FOUND, f"raster {name} has tiles that end in .{raster.ending}")
        if not raster.minzoom <= tile.zoom <= raster.maxzoom:
            limits = f"{raster.minzoom} to {raster.maxzoom}"
            raise Problem(HTTPStatus.NOT_FOUND, f"raster {name} has zoom {limits}: {tile.zoom} was asked for")
        content = await asyncio.to_thread(_content, raster, tile)
        own = f'"{blake2b(content, digest_size=16).hexdigest()}"'
        headers = {"ETag": own, "Cache-Control": KEPT}
        if own in {one.strip().removeprefix("W/") for one in etag.split(",")}:
            return Response(None, HTTPStatus.NOT_MODIFIED, headers)
        if not content:
            return Response(None, HTTPStatus.NO_CONTENT, headers)
        return Response(content, HTTPStatus.OK, headers, PICTURES[raster.ending])


def _content(raster: RasterSettings, tile: WebTile) -> bytes:
    """The tile's file, empty where there is none; its name is made of numbers alone, and a link does not lead out of
    the folder. Raises Problem for a file too large."""
    folder = raster.folder.resolve()
    path = folder / str(tile.zoom) / str(tile.column) / f"{tile.row}.{raster.ending}"
    try:
        resolved = path.resolve(strict=True)
        if not resolved.is_relative_to(folder) or not resolved.is_file():
            return b""
        if resolved.stat().st_size > TILE_MOST_BYTES:
            detail = f"a tile of raster {raster.name} has more than {TILE_MOST_BYTES} bytes"
            raise Problem(HTTPStatus.INTERNAL_SERVER_ERROR, detail)
        return resolved.read_bytes()
    except FileNotFoundError:
        return b""


def _described(one: RasterSettings) -> JsonObject:
    return {
        "name": one.name,
        "title": one.title or one.name,
        "kind": one.kind,
        "tiles": [f"/rasters/{one.name}/{{z}}/{{x}}/{{y}}.{one.ending}"],
        "bounds": list(one.bounds),
        "minzoom": one.minzoom,
        "maxzoom": one.maxzoom,
        "tile_size": TILE_SIZE,
        "attribution": one.attribution,
        "images": list(one.images),
    }
