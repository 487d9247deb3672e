"""Folders served over HTTP on this machine, a range of bytes at a time where one is asked for."""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from mimetypes import guess_type
from pathlib import Path
from threading import Thread
from urllib.parse import urlsplit

RANGE = re.compile(r"bytes=(\d+)-(\d+)")


class _Handler(BaseHTTPRequestHandler):
    def __init__(self, mounts: Mapping[str, Path], *rest: object) -> None:
        self.mounts = mounts
        super().__init__(*rest)  # type: ignore[arg-type]

    def do_GET(self) -> None:
        _, mount, name = urlsplit(self.path).path.split("/", 2)
        path = self.mounts.get(mount, Path("absent")) / name
        if not path.is_file():
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        content, kind = path.read_bytes(), guess_type(path.name)[0] or "application/octet-stream"
        kind = "text/javascript" if path.suffix == ".mjs" else kind
        asked = RANGE.fullmatch(self.headers.get("Range", ""))
        first, last = (int(asked[1]), min(int(asked[2]), len(content) - 1)) if asked else (0, len(content) - 1)
        self.send_response(HTTPStatus.PARTIAL_CONTENT if asked else HTTPStatus.OK)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(last - first + 1))
        if asked:
            self.send_header("Content-Range", f"bytes {first}-{last}/{len(content)}")
        self.end_headers()
        self.wfile.write(content[first : last + 1])

    def log_message(self, format: str, *arguments: object) -> None:
        """Nothing: a test's output is its own."""


@contextmanager
def serving_files(mounts: Mapping[str, Path]) -> Iterator[str]:
    """The address at which each folder is found under its name, until the end."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Handler, mounts))
    thread = Thread(target=server.serve_forever)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
