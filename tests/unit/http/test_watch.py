"""The newest version is known by looking, and sooner by word of it."""

import asyncio

import pytest

from map_http.scripted import ScriptedSource, map_of
from trigpoint.errors import DatabaseUnavailable
from trigpoint.landmarks.feature_query import MapState
from trigpoint_landmarks.http.map_watch import MapWatch
from trigpoint_landmarks.http.problems import Problem


@pytest.fixture
def source() -> ScriptedSource:
    return ScriptedSource()


def test_a_version_that_was_told_of_is_known_at_once(source: ScriptedSource) -> None:
    async def seen() -> int:
        watch = MapWatch(source, look_s=600.0)
        following = asyncio.create_task(watch.follow())
        while watch.state is None:
            await asyncio.sleep(0)
        source.now = map_of([1, 2])
        watch.tell()
        while watch.state.newest == 1:
            await asyncio.sleep(0)
        following.cancel()
        return watch.state.newest

    assert asyncio.run(asyncio.wait_for(seen(), 5.0)) == 2


def test_a_version_that_is_asked_for_is_looked_for(source: ScriptedSource) -> None:
    async def asked() -> MapState:
        watch = MapWatch(source, look_s=600.0)
        known = await watch.current()
        assert known is not None
        source.now = map_of([1, 2])
        return await watch.version(2, known)

    assert asyncio.run(asked()).versions == (1, 2)


def test_an_old_version_that_is_gone_is_not_looked_for(source: ScriptedSource) -> None:
    async def asked() -> None:
        watch = MapWatch(source, look_s=600.0)
        known = await watch.current()
        assert known is not None
        await watch.version(0, known)

    with pytest.raises(Problem, match="map version 0 is unknown: 1 to 1 are there"):
        asyncio.run(asked())
    assert source.looks == 1


def test_a_database_that_comes_back_is_asked_again(source: ScriptedSource) -> None:
    async def asked() -> tuple[bool, bool]:
        watch = MapWatch(source, look_s=600.0)
        source.away = True
        with pytest.raises(DatabaseUnavailable):
            await watch.current()
        before = watch.reached
        source.away = False
        await watch.current()
        return before, watch.reached

    assert asyncio.run(asked()) == (False, True)
