"""What is asked of the map over the bus, and what is answered and told, as values."""

from dataclasses import dataclass
from enum import Enum

from trigpoint.geodesy.positions import GridPosition
from trigpoint.geodesy.projection import MapFrame, pin_map_frame
from trigpoint.geodesy.web_tiles import WebTile
from trigpoint.landmarks.model import Landmark, MapVersion
from trigpoint.landmarks.queries import DegreeBox, LandmarkQuery, TimeSpan

GEOJSON = "application/geo+json"

Point = tuple[float, float]


class AnswerForm(Enum):
    """How landmarks are answered."""

    PROTOBUF = "protobuf"
    GEOJSON = "geojson"


@dataclass(frozen=True, slots=True, kw_only=True)
class LandmarkQuestion:
    """Landmarks asked for: `page` the token of the answer before, `crs` in which positions are given besides degrees
    (in GeoJSON instead of them)."""

    query: LandmarkQuery
    page: str = ""
    crs: str = ""
    form: AnswerForm = AnswerForm.PROTOBUF


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeQuestion:
    """What differs between version `since` and the query's, among the landmarks that meet the query."""

    query: LandmarkQuery
    since: int


@dataclass(frozen=True, slots=True, kw_only=True)
class CoverageQuestion:
    """Which tiles were observed when: of an area, in a span of time, by one vehicle; None: any."""

    bbox: DegreeBox | None = None
    seen: TimeSpan | None = None
    vehicle: str | None = None


Question = LandmarkQuestion | ChangeQuestion | CoverageQuestion


@dataclass(frozen=True, slots=True, kw_only=True)
class AnsweredMap:
    """The map version an answer is of (0: there is none yet), when it was solved, and its frame."""

    map_version: int = 0
    solved_ns: int = 0
    crs: str = ""
    origin_easting_m: float = 0.0
    origin_northing_m: float = 0.0

    def frame(self) -> MapFrame:
        """The map's frame. Raises FrameRefused while there is no version."""
        return pin_map_frame(crs=self.crs, origin=GridPosition(self.origin_easting_m, self.origin_northing_m))


def answered_map(version: MapVersion | None) -> AnsweredMap:
    """What an answer says of its version."""
    if version is None:
        return AnsweredMap()
    return AnsweredMap(
        map_version=version.map_version,
        solved_ns=version.solved_ns,
        crs=version.crs,
        origin_easting_m=version.origin_easting_m,
        origin_northing_m=version.origin_northing_m,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class LandmarkAnswer:
    """A page of landmarks, all of one version; their provenance is not told. `points`: x and y of each in `crs`, none
    where no CRS was asked for. `next_page`: the token of the next page, "" at the end."""

    map: AnsweredMap
    landmarks: tuple[Landmark, ...]
    crs: str = ""
    points: tuple[Point, ...] = ()
    next_page: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeAnswer:
    """What someone who holds version `since` needs to hold that of `map`."""

    map: AnsweredMap
    since: int
    changed: tuple[Landmark, ...]
    removed: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CoveredTile:
    """A pass over a tile: `sweep_count` sweeps of one vehicle that reached its middle, without a longer pause."""

    tile: WebTile
    vehicle: str
    first_ns: int
    last_ns: int
    sweep_count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class CoverageAnswer:
    """The passes over the tiles that were asked for; a tile without any was not observed, as far as is known."""

    map: AnsweredMap
    tiles: tuple[CoveredTile, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Refusal:
    """Instead of an answer; `reason` is a stable short word."""

    reason: str
    detail: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TileChange:
    """What became different in one tile from version `before` to `after`: landmarks of `after` that lie there, and ids
    of those that lay there and do not any more."""

    tile: WebTile
    before: int
    after: int
    changed: tuple[Landmark, ...]
    removed: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class VersionChange:
    """A version is durable, the one before it, and the tiles in which they differ; None: too many to be told."""

    map: AnsweredMap
    before: int
    tiles: frozenset[WebTile] | None
