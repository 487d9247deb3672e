"""One map version read layer by layer and page by page: no more than a page of it is in memory."""

import asyncio
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from trigpoint.errors import InputError
from trigpoint.landmarks.conditions import Condition
from trigpoint.landmarks.feature_crs import CRS84, FeatureCrs
from trigpoint.landmarks.feature_query import PAGE_MOST, FeaturePage, FeatureQuery, FeatureSource, MapState
from trigpoint.landmarks.layers import LANDMARKS, Layer
from trigpoint.landmarks.model import MapVersion
from trigpoint.landmarks.queries import DegreeBox, TimeSpan
from trigpoint_landmarks.export.placed import PlacedFeature, placed, source_crs
from trigpoint_landmarks.http.drive_pages import drive_page
from trigpoint_landmarks.http.ports import DriveRow

LINES_A_PAGE = 16  # a path of a long drive has tens of thousands of points

Batch = list[PlacedFeature]


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """Which features: those in a box, if one is given, that meet their layer's condition, if there is one."""

    box: DegreeBox | None = None
    conditions: Mapping[str, Condition] = field(default_factory=dict)


class MapReading:
    """One version of a map in a source, which `runner` asks; `drives`: those of the log, None without a log.

    Methods raise DatabaseUnavailable where the database is away, InputError for what it cannot hold.
    """

    def __init__(
        self, source: FeatureSource, runner: asyncio.Runner, version: MapVersion, drives: Sequence[DriveRow] | None
    ) -> None:
        self._source, self._runner, self._drives = source, runner, drives
        self.version = version
        self._state = self._current()

    def batches(self, layer: Layer, crs: FeatureCrs, selection: Selection) -> Iterator[Batch]:
        """The features of a layer in order of id. Raises InputError for drives where there is no log."""
        asked = source_crs(crs, self._state.crs)
        query = FeatureQuery(
            layer=layer,
            limit=LINES_A_PAGE if layer.geometry == "LineString" else PAGE_MOST,
            as_of=self.version.map_version,
            areas=() if selection.box is None else (selection.box,),
            condition=selection.conditions.get(layer.name),
            crs=asked,
        )
        for page in self._pages(query):
            yield placed(page.features, asked, crs)

    def seen(self) -> TimeSpan | None:
        """When the landmarks of the version were observed, from the first moment to the last; None without any."""
        if self.version.map_version == self._state.newest:
            return self._state.seen
        spans = [_span(batch) for batch in self.batches(LANDMARKS, CRS84, Selection()) if batch]
        if not spans:
            return None
        return TimeSpan(first_ns=min(one.first_ns for one in spans), last_ns=max(one.last_ns for one in spans))

    def _pages(self, query: FeatureQuery) -> Iterator[FeaturePage]:
        page = self._page(query)
        yield page
        while page.next_id is not None:
            page = self._page(replace(query, first_id=page.next_id))
            yield page

    def _page(self, query: FeatureQuery) -> FeaturePage:
        if query.layer.stored:
            return self._runner.run(self._source.page(query, self._state))
        if self._drives is None:
            raise InputError(
                f"layer {query.layer.name}: drives stand in the log, and there is none in the data directory"
            )
        return drive_page(self._drives, query, map_version=self.version.map_version)

    def _current(self) -> MapState:
        state = self._runner.run(self._source.state(None))
        if state is None or self.version.map_version not in state.versions:
            raise InputError(f"map version {self.version.map_version} is gone from the database")
        return state


def _span(landmarks: Batch) -> TimeSpan:
    """When landmarks, at least one, were observed."""
    return TimeSpan(
        first_ns=min(_stamp_ns(one, "first_seen_ns") for one in landmarks),
        last_ns=max(_stamp_ns(one, "last_seen_ns") for one in landmarks),
    )


def _stamp_ns(landmark: PlacedFeature, name: str) -> int:
    stamp_ns = landmark.properties[name]
    assert isinstance(stamp_ns, int)
    return stamp_ns
