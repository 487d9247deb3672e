"""The map asked from asyncio: the same questions, each awaited."""

import asyncio
from collections.abc import AsyncIterator
from typing import Any

from trigpoint.bus.ports import Bus
from trigpoint.client.asking import EVERYTHING, EVERYWHERE, TIMEOUT_S, MapClient
from trigpoint.client.core.constellations import Constellation
from trigpoint.client.core.known_landmarks import EXPECTED, GnssPrior
from trigpoint.client.core.motion_fit import Expectation
from trigpoint.client.core.placing import Placed, VehiclePose
from trigpoint.client.core.relocalisation import Relocalised
from trigpoint.events.keys import DEFAULT_MAP, DEFAULT_ROOT
from trigpoint.geodesy.projection import MapFrame
from trigpoint.landmarks.asked import ChangeAnswer, CoverageAnswer, CoverageQuestion, LandmarkAnswer
from trigpoint.landmarks.queries import LandmarkQuery


class AsyncMapClient:
    """A MapClient whose methods are awaited; each waits in a thread, so that the loop goes on meanwhile."""

    def __init__(
        self, bus: Bus, *, root: str = DEFAULT_ROOT, map_name: str = DEFAULT_MAP, timeout_s: float = TIMEOUT_S
    ) -> None:
        self._client = MapClient(bus, root=root, map_name=map_name, timeout_s=timeout_s)

    async def landmarks(self, query: LandmarkQuery = EVERYTHING, *, page: str = "", crs: str = "") -> LandmarkAnswer:
        """As MapClient's."""
        return await asyncio.to_thread(self._client.landmarks, query, page=page, crs=crs)

    async def pages(self, query: LandmarkQuery = EVERYTHING, *, crs: str = "") -> AsyncIterator[LandmarkAnswer]:
        """As MapClient's."""
        answer = await self.landmarks(query, crs=crs)
        yield answer
        while answer.next_page:
            answer = await self.landmarks(query, page=answer.next_page, crs=crs)
            yield answer

    async def geojson(self, query: LandmarkQuery = EVERYTHING, *, page: str = "", crs: str = "") -> dict[str, Any]:
        """As MapClient's."""
        return await asyncio.to_thread(self._client.geojson, query, page=page, crs=crs)

    async def changes(self, since: int, query: LandmarkQuery = EVERYTHING) -> ChangeAnswer:
        """As MapClient's."""
        return await asyncio.to_thread(self._client.changes, since, query)

    async def coverage(self, question: CoverageQuestion = EVERYWHERE) -> CoverageAnswer:
        """As MapClient's."""
        return await asyncio.to_thread(self._client.coverage, question)

    async def frame(self) -> MapFrame:
        """As MapClient's."""
        return await asyncio.to_thread(self._client.frame)

    async def place(self, detections: Constellation, pose: VehiclePose) -> Placed:
        """As MapClient's."""
        return await asyncio.to_thread(self._client.place, detections, pose)

    async def relocalise(
        self, observations: Constellation, gnss_prior: GnssPrior, *, expected: Expectation = EXPECTED
    ) -> Relocalised | None:
        """As MapClient's."""
        return await asyncio.to_thread(self._client.relocalise, observations, gnss_prior, expected=expected)
