"""Who follows the map's versions is told of each one, is bounded in number, and is let go in the end."""

import asyncio
import json
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from map_http.scripted import ScriptedSource, map_of
from trigpoint.errors import DatabaseUnavailable
from trigpoint.observability.metrics import Instruments
from trigpoint_landmarks.http.event_stream import VersionFeed
from trigpoint_landmarks.http.map_watch import MapWatch
from trigpoint_landmarks.http.problems import Problem

NOW_NS = 1_700_000_000_000_000_000
PATIENCE_S = 10.0


class Listener:
    """One who listens to a feed; `said` are the parts of the answer's body as they come."""

    def __init__(self, feed: VersionFeed, method: str = "GET") -> None:
        self.said: asyncio.Queue[bytes] = asyncio.Queue()
        self.gone = asyncio.Event()
        scope = {"type": "http", "method": method, "path": "/events", "headers": [], "asgi": {"spec_version": "2.3"}}
        self.task = asyncio.create_task(feed.serve(scope, self._receive, self._send))

    async def event(self) -> tuple[str, Any]:
        """The next event's name and data."""
        text = (await asyncio.wait_for(self.said.get(), PATIENCE_S)).decode()
        lines = dict(line.split(": ", 1) for line in text.strip().split("\n"))
        return lines["event"], json.loads(lines["data"])

    async def _receive(self) -> dict[str, str]:
        await self.gone.wait()
        return {"type": "http.disconnect"}

    async def _send(self, message: Any) -> None:
        if message["type"] == "http.response.body" and message.get("body"):
            self.said.put_nowait(message["body"])


Story = Callable[[ScriptedSource, MapWatch, VersionFeed], Awaitable[None]]


def followed(story: Story, *, limit: int = 2) -> Instruments:
    """A story told with a feed of a map whose first version is known."""
    instruments = Instruments("http")

    async def told() -> None:
        source = ScriptedSource()
        watch = MapWatch(source, look_s=600.0)
        await watch.look()
        await story(source, watch, VersionFeed(watch, instruments, limit=limit, now_ns=lambda: NOW_NS))

    asyncio.run(told())
    return instruments


def test_the_newest_version_is_told_at_once_and_the_next_as_it_comes() -> None:
    async def story(source: ScriptedSource, watch: MapWatch, feed: VersionFeed) -> None:
        listener = Listener(feed)
        name, data = await listener.event()
        assert (name, data["map_version"], data["now_ns"], data["database_reached"]) == ("version", 1, NOW_NS, True)
        source.now = map_of([1, 2])
        await watch.look()
        name, data = await listener.event()
        assert (name, data["map_version"]) == ("version", 2)
        watch.close()
        await asyncio.wait_for(listener.task, PATIENCE_S)

    followed(story)


def test_before_the_first_version_there_is_none_to_tell() -> None:
    async def story(source: ScriptedSource, watch: MapWatch, feed: VersionFeed) -> None:
        source.now = None
        await watch.look()
        listener = Listener(feed)
        assert (await listener.event())[1]["map_version"] is None
        watch.close()
        await asyncio.wait_for(listener.task, PATIENCE_S)

    followed(story)


def test_a_database_that_goes_away_is_told_of() -> None:
    async def story(source: ScriptedSource, watch: MapWatch, feed: VersionFeed) -> None:
        listener = Listener(feed)
        await listener.event()
        source.away = True
        with pytest.raises(DatabaseUnavailable):
            await watch.look()
        name, data = await listener.event()
        assert (name, data["map_version"], data["database_reached"]) == ("alive", 1, False)
        watch.close()
        await asyncio.wait_for(listener.task, PATIENCE_S)

    followed(story)


def test_one_too_many_is_refused_with_how_many_there_are() -> None:
    async def story(source: ScriptedSource, watch: MapWatch, feed: VersionFeed) -> None:
        there = [Listener(feed), Listener(feed)]
        for one in there:
            await one.event()
        with pytest.raises(Problem, match="2 listen already") as refused:
            await Listener(feed).task
        assert refused.value.headers["Retry-After"] == "5"
        watch.close()
        await asyncio.wait_for(asyncio.gather(*(one.task for one in there)), PATIENCE_S)

    assert b"trigpoint_listeners 0.0" in followed(story).exposition()


def test_who_goes_makes_room() -> None:
    async def story(source: ScriptedSource, watch: MapWatch, feed: VersionFeed) -> None:
        listener = Listener(feed)
        await listener.event()
        assert feed.listeners == 1
        listener.gone.set()
        await asyncio.wait_for(listener.task, PATIENCE_S)
        assert feed.listeners == 0

    followed(story)


def test_whoever_asks_for_the_head_only_is_not_kept() -> None:
    async def story(source: ScriptedSource, watch: MapWatch, feed: VersionFeed) -> None:
        listener = Listener(feed, "HEAD")
        await asyncio.wait_for(listener.task, PATIENCE_S)
        assert listener.said.empty()

    followed(story)
