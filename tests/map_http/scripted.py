"""A source that knows of versions what a test says, and nothing else."""

from collections.abc import Sequence

from trigpoint.errors import DatabaseUnavailable
from trigpoint.geodesy.web_tiles import WebTile
from trigpoint.landmarks.feature_query import FeaturePage, FeatureQuery, MapState, VersionSummary
from trigpoint.landmarks.layers import Layer
from trigpoint.landmarks.model import LabelGain

UNASKED = "whoever watches asks for no features"


def map_of(versions: Sequence[int]) -> MapState:
    return MapState(
        versions=tuple(versions),
        crs="EPSG:32756",
        origin_easting_m=0.0,
        origin_northing_m=0.0,
        solved_ns=0,
        box=None,
        seen=None,
    )


class ScriptedSource:
    """A source whose state is as the test says; `looks` counts how often it was asked."""

    def __init__(self) -> None:
        self.now: MapState | None = map_of([1])
        self.away = False
        self.looks = 0

    async def state(self, known: MapState | None) -> MapState | None:
        self.looks += 1
        if self.away:
            raise DatabaseUnavailable("away")
        return self.now

    async def page(self, query: FeatureQuery, state: MapState) -> FeaturePage:
        raise AssertionError(UNASKED)

    async def tile(self, layer: Layer, tile: WebTile, state: MapState, *, as_of: int) -> bytes:
        raise AssertionError(UNASKED)

    async def history(self, limit: int) -> tuple[VersionSummary, ...]:
        raise AssertionError(UNASKED)

    async def settings_json(self, as_of: int) -> str:
        raise AssertionError(UNASKED)

    async def label_gains(self, as_of: int) -> tuple[LabelGain, ...]:
        raise AssertionError(UNASKED)

    async def close(self) -> None:
        pass
