"""The viewer's files, as `make viewer` built them: one page, and what it fetches, from nowhere but here."""

import mimetypes
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path

from starlette.responses import RedirectResponse, Response

from trigpoint_landmarks.http.problems import Problem

BUILT = Path(__file__).resolve().parent.parent / "viewer" / "dist"
PREFIX = "/viewer"
PAGE = "index.html"
YEAR_S = 31_536_000
MIME_TYPES = {
    ".js": "text/javascript",
    ".css": "text/css",
    ".svg": "image/svg+xml",
    ".html": "text/html; charset=utf-8",
}
# Scripts, styles, workers, pictures and data come from this service alone; what MapLibre draws, it makes itself.
POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "worker-src 'self' blob:",
        "child-src blob:",
        "img-src 'self' data: blob:",
        "font-src 'self'",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)


@dataclass(frozen=True, slots=True)
class ViewerFiles:
    """The files under a folder, read once: there are few, and none that is not there then is served.

    The names of all but the page hold a digest of their content: those may be kept for ever.
    """

    files: dict[str, bytes]

    def answer(self, path: str) -> Response:
        """The file at a path below `PREFIX`. Raises Problem where there is none."""
        if path == "":
            return RedirectResponse(f"{PREFIX.removeprefix('/')}/", HTTPStatus.PERMANENT_REDIRECT)
        if not self.files:
            detail = "the viewer was not built here: `make viewer` builds it, then start the service again"
            raise Problem(HTTPStatus.NOT_FOUND, detail)
        name = path.removeprefix("/") or PAGE
        content = self.files.get(name)
        if content is None:
            raise Problem(HTTPStatus.NOT_FOUND, f"the viewer has no file {name[:100]!r}")
        kept = "no-cache" if name == PAGE else f"public, max-age={YEAR_S}, immutable"
        headers = {"Cache-Control": kept, "Content-Security-Policy": POLICY}
        return Response(content, HTTPStatus.OK, headers, _mime_type(name))


def viewer_files(folder: Path = BUILT) -> ViewerFiles:
    """The files there are; none where the viewer was not built."""
    found = (path for path in folder.rglob("*") if path.is_file())
    return ViewerFiles({path.relative_to(folder).as_posix(): path.read_bytes() for path in found})


def _mime_type(name: str) -> str:
    known = MIME_TYPES.get(Path(name).suffix)
    return known or mimetypes.guess_type(name)[0] or "application/octet-stream"
