"""The HTTP service's application asked in this process."""

import asyncio
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx

from trigpoint.landmarks.feature_query import FeatureSource
from trigpoint.observability.metrics import Instruments
from trigpoint_landmarks.http.application import Served, application
from trigpoint_landmarks.http.map_watch import MapWatch
from trigpoint_landmarks.http.ports import MapCorrections, MeasuredDrives
from trigpoint_landmarks.http.settings import WebSettings
from trigpoint_landmarks.http.tokens import Scope, issue_token

BASE_URL = "http://127.0.0.1:8080"


@dataclass(slots=True)
class Api:
    """An application and the event loop it is asked in."""

    runner: asyncio.Runner
    served: Any
    watch: MapWatch
    corrections: MapCorrections | None
    instruments: Instruments

    def ask(self, method: str, path: str, **more: Any) -> httpx.Response:
        """The answer to one request."""
        return self.runner.run(self.asked(method, path, **more))

    def get(self, path: str, **more: Any) -> httpx.Response:
        """The answer to a GET."""
        return self.ask("GET", path, **more)

    def told(self, path: str, **parameters: Any) -> Any:
        """The JSON at a path that answers with one."""
        answer = self.get(path, params=parameters or None)
        assert answer.status_code == 200, answer.text
        return answer.json()

    def ids(self, path: str, **parameters: Any) -> list[str]:
        """The ids of a page's features."""
        return [feature["id"] for feature in self.told(path, **parameters)["features"]]

    async def asked(self, method: str, path: str, *, client: str = "127.0.0.1", **more: Any) -> httpx.Response:
        """The answer to one request, in the event loop."""
        transport = httpx.ASGITransport(app=self.served, client=(client, 1234))
        async with httpx.AsyncClient(transport=transport, base_url=BASE_URL) as asking:
            return await asking.request(method, path, **more)


@contextmanager
def asked_api(
    source: FeatureSource,
    runner: asyncio.Runner,
    settings: WebSettings | None = None,
    *,
    corrections: MapCorrections | None = None,
    drives: MeasuredDrives | None = None,
    shifts: Path | None = None,
) -> Iterator[Api]:
    """The application on a source."""
    chosen = settings or WebSettings()
    watch, instruments = MapWatch(source, look_s=chosen.look_s), Instruments("http")

    async def made() -> Any:
        served = Served(source=source, watch=watch, corrections=corrections, drives=drives, shifts=shifts)
        return application(chosen, served, instruments)

    yield Api(runner, runner.run(made()), watch, corrections, instruments)
    runner.run(source.close())


def issued(folder: Path, *scopes: Scope) -> tuple[Path, dict[Scope, dict[str, str]]]:
    """A token file with a token of each scope, and the header that shows each."""
    path = folder / "tokens.json"
    secrets = {scope: issue_token(path, f"a-{scope.value}", scope, now_s=0)[1] for scope in scopes or tuple(Scope)}
    return path, {scope: {"Authorization": f"Bearer {secret}"} for scope, secret in secrets.items()}


def problem(answer: httpx.Response) -> Any:
    """The problem an answer tells of; fails for any other answer."""
    assert answer.headers["content-type"] == "application/problem+json", answer.text
    found = json.loads(answer.content)
    assert found["status"] == answer.status_code
    assert {"type", "title", "detail"} <= found.keys()
    return found
