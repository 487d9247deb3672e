"""Which map version is the newest: known at once when the bus tells of one, by looking otherwise."""

import asyncio
import logging
from http import HTTPStatus

from trigpoint.errors import DatabaseUnavailable, TrigpointError
from trigpoint.landmarks.feature_query import FeatureSource, MapState
from trigpoint_landmarks.http.problems import Problem

AGAIN_S = 0.05  # between looks after word of a version that is not in the database yet
SOON_S = 5.0  # for how long

logger = logging.getLogger(__name__)


class MapWatch:
    """What is known of the map, kept up to date while `follow` runs."""

    def __init__(self, source: FeatureSource, *, look_s: float) -> None:
        self._source, self._look_s = source, look_s
        self._state: MapState | None = None
        self._told = asyncio.Event()
        self.changed = asyncio.Event()  # set, and another one in its place, with each new version and what else changes
        self.closed = False
        self.reached = False  # the database, at the last look

    @property
    def state(self) -> MapState | None:
        """The map at the last look, None before its first version."""
        return self._state

    def tell(self) -> None:
        """A version was solved: it will be in the database soon. In the event loop's thread."""
        self._told.set()

    async def look(self) -> None:
        """The map as it is now. Raises DatabaseUnavailable, and what else the source does."""
        try:
            state = await self._source.state(self._state)
        except TrigpointError:
            self._become(self._state, reached=False)
            raise
        self._become(state, reached=True)

    async def changes(self, since: asyncio.Event, *, within_s: float) -> None:
        """Until something is other than when `changed` was `since`, or so long."""
        try:
            await asyncio.wait_for(since.wait(), within_s)
        except TimeoutError:
            return

    def close(self) -> None:
        """Whoever waits for changes is told that none will come."""
        self.closed = True
        self._announce()

    def _become(self, state: MapState | None, *, reached: bool) -> None:
        changed = state is not self._state or reached is not self.reached
        self._state, self.reached = state, reached
        if changed:
            self._announce()

    def _announce(self) -> None:
        """Who waits goes on; who asks from now on waits for the next change."""
        announced, self.changed = self.changed, asyncio.Event()
        announced.set()

    async def current(self) -> MapState | None:
        """The map; looked at where the database was away at the last look."""
        if not self.reached:
            await self.look()
        return self._state

    async def version(self, as_of: int | None, state: MapState) -> MapState:
        """The map with the version asked for in it. Raises Problem for a version that is not there."""
        if as_of is None or as_of in state.versions:
            return state
        if as_of > state.newest:
            await self.look()
            if self._state is not None and as_of in self._state.versions:
                return self._state
        limits = f"{state.versions[0]} to {state.newest} are there"
        raise Problem(HTTPStatus.NOT_FOUND, f"map version {as_of} is unknown: {limits}")

    async def follow(self) -> None:
        """Looks until it is cancelled; a database that is away is told of once."""
        while True:
            was_reached = self.reached
            try:
                await self.look()
            except DatabaseUnavailable as error:
                if was_reached:
                    logger.warning("looked at again in %g s: %s", self._look_s, error)
            except TrigpointError as error:
                logger.error("looked at again in %g s: %s", self._look_s, error)
            await self._wait()

    async def _wait(self) -> None:
        """Until it is time to look again."""
        try:
            await asyncio.wait_for(self._told.wait(), self._look_s)
        except TimeoutError:
            return
        self._told.clear()
        await self._await_newer()

    async def _await_newer(self) -> None:
        """Until the version that was told of is in the database, or is refused, for all that is known."""
        before = self._state
        for _ in range(round(SOON_S / AGAIN_S)):
            try:
                await self.look()
            except TrigpointError:
                return  # `follow` looks again, and says so
            if self._state is not before:
                return
            await asyncio.sleep(AGAIN_S)
