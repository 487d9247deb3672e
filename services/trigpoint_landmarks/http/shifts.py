"""Where aerial images lie beside the ortho layer: the check layers of a folder, as `trigpoint ortho register` left them
there."""

import asyncio
from dataclasses import dataclass
from hashlib import blake2b
from http import HTTPStatus
from pathlib import Path
from urllib.parse import quote

from starlette.responses import Response

from trigpoint_landmarks.http.documents import GEOJSON, JsonObject
from trigpoint_landmarks.http.problems import Problem

ENDING = ".geojson"
LAYER_MOST_BYTES = 64 * 1024 * 1024  # 100,000 tiles of 50 m, more than a browser draws


@dataclass(frozen=True, slots=True)
class Shifts:
    """The check layers there are, a file named by its image each; no folder: none."""

    folder: Path | None

    async def document(self) -> JsonObject:
        """The images that were registered."""
        names = await asyncio.to_thread(self._names)
        return {"shifts": [{"image": name, "tiles": f"/shifts/{quote(name, safe='')}"} for name in names]}

    async def layer(self, image: str, *, etag: str) -> Response:
        """An image's tiles as GeoJSON. Raises Problem where there are none."""
        content = await asyncio.to_thread(self._content, image)
        own = f'"{blake2b(content, digest_size=16).hexdigest()}"'
        headers = {"ETag": own, "Cache-Control": "no-cache"}
        if own in {one.strip().removeprefix("W/") for one in etag.split(",")}:
            return Response(None, HTTPStatus.NOT_MODIFIED, headers)
        return Response(content, HTTPStatus.OK, headers, GEOJSON)

    def _names(self) -> list[str]:
        if self.folder is None or not self.folder.is_dir():
            return []
        return sorted(path.stem for path in self.folder.glob(f"*{ENDING}") if path.is_file() and not path.is_symlink())

    def _content(self, image: str) -> bytes:
        """The file of an image that is listed: no other name reaches the disk."""
        names = self._names()
        if self.folder is None or image not in names:
            raise Problem(HTTPStatus.NOT_FOUND, f"no shifts of image {image[:40]!r}: there are {len(names)} images")
        path = self.folder / f"{image}{ENDING}"
        if path.stat().st_size > LAYER_MOST_BYTES:
            detail = f"the shifts of image {image[:40]} are more than {LAYER_MOST_BYTES} bytes"
            raise Problem(HTTPStatus.INTERNAL_SERVER_ERROR, detail)
        return path.read_bytes()
