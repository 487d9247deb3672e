"""Questions for pages of features and for vector tiles, and who answers them."""

from dataclasses import dataclass
from typing import Protocol

from trigpoint.errors import InputError
from trigpoint.geodesy.web_tiles import WebTile
from trigpoint.landmarks.conditions import Condition
from trigpoint.landmarks.feature_crs import CRS84, FeatureCrs
from trigpoint.landmarks.layers import Layer
from trigpoint.landmarks.model import LabelGain
from trigpoint.landmarks.queries import DegreeBox, TimeSpan

PAGE_MOST = 10_000  # features


@dataclass(frozen=True, slots=True, kw_only=True)
class GridBox:
    """A closed box on the map's grid, in metres."""

    easting_min_m: float
    northing_min_m: float
    easting_max_m: float
    northing_max_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FeatureQuery:
    """Which features of a layer are asked for: all conditions hold together; None, or no area, asks for anything.

    `areas`: one of them. `during`: the feature's own span meets it, if it has one. `as_of` is a map version, None the
    newest. The answer is in order of id and begins at `first_id`. Raises InputError for a limit out of range.
    """

    layer: Layer
    limit: int
    as_of: int | None = None
    areas: tuple[DegreeBox | GridBox, ...] = ()
    during: TimeSpan | None = None
    condition: Condition | None = None
    feature_id: str | None = None
    first_id: str | None = None
    crs: FeatureCrs = CRS84

    def __post_init__(self) -> None:
        if not 1 <= self.limit <= PAGE_MOST:
            raise InputError(f"limit {self.limit} is outside 1 to {PAGE_MOST}")


@dataclass(frozen=True, slots=True, kw_only=True)
class FeaturePage:
    """Features of one map version (0: there is none yet) as GeoJSON texts with commas between them.

    `next_id` is the first feature of the next page, None at the end.
    """

    map_version: int
    features: bytes
    count: int
    next_id: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class MapState:
    """What is known of a map: its versions in order, the newest one's frame, and all landmarks' box and span."""

    versions: tuple[int, ...]
    crs: str
    origin_easting_m: float
    origin_northing_m: float
    solved_ns: int
    box: DegreeBox | None
    seen: TimeSpan | None

    @property
    def newest(self) -> int:
        """The newest version."""
        return self.versions[-1]


@dataclass(frozen=True, slots=True, kw_only=True)
class VersionSummary:
    """What is said of a map version in a list of many; `base_version` 0: it was solved whole."""

    map_version: int
    base_version: int
    method: str
    landmark_count: int
    anchor_count: int
    wall_s: float
    solved_ns: int


class FeatureSource(Protocol):
    """Answers from one landmark database, which it only reads.

    Every method raises DatabaseUnavailable where the database is away or busy, and InputError for a value it cannot
    hold; `as_of` is a version that is there.
    """

    async def state(self, known: MapState | None) -> MapState | None:
        """The map as it is now, `known` itself if nothing has changed; None while there is no version."""

    async def page(self, query: FeatureQuery, state: MapState) -> FeaturePage:
        """The features that meet a query."""

    async def tile(self, layer: Layer, tile: WebTile, state: MapState, *, as_of: int) -> bytes:
        """The vector tile of a layer that has any, empty if nothing is in it."""

    async def history(self, limit: int) -> tuple[VersionSummary, ...]:
        """The newest versions, so many at most, in order."""

    async def settings_json(self, as_of: int) -> str:
        """The settings a version was solved with."""

    async def label_gains(self, as_of: int) -> tuple[LabelGain, ...]:
        """What one more label would tell by the newest version solved whole up to this one, in order of image."""

    async def close(self) -> None:
        """Nothing more is held open."""
