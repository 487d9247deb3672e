"""What can be asked of a landmark map, checked before it is asked."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from trigpoint.errors import InputError
from trigpoint.landmarks.model import MapVersion

METRES_PER_DEGREE = 110_574.0  # of latitude, at the equator, where WGS84 has the fewest; of longitude times cos(lat)
LAT_LIMIT_DEG = 90.0
LON_LIMIT_DEG = 180.0
MAX_RADIUS_M = 100_000.0  # a landmark map is a district's, not a continent's
NEAREST_MOST = 10_000  # landmarks around one position
KINDS_MOST = 64  # in one question
SIGMA_LIMIT_M = 1e6  # beyond it a position says nothing
WHOLE_LIMIT = 2**63  # of whole numbers: 64 bits hold them in every database
TEXT_LIMIT = 1000  # characters of a name that is asked for


def _require_within(name: str, value: float, limit: float) -> None:
    if not abs(value) <= limit:
        raise InputError(f"{name} {value} is outside -{limit:g} to {limit:g}")


def require_whole(name: str, value: int) -> None:
    """Raises InputError for a number beyond 64 bits."""
    if not -WHOLE_LIMIT <= value < WHOLE_LIMIT:
        raise InputError(f"{name} {value} is outside -2^63 to 2^63 - 1")


def _require_text(name: str, text: str, *, least: int = 1) -> None:
    """Raises InputError for a text that no database holds."""
    if not least <= len(text) <= TEXT_LIMIT:
        raise InputError(f"{name} has {len(text)} characters: {least} to {TEXT_LIMIT} are allowed")
    if any(character == "\0" or "\ud800" <= character <= "\udfff" for character in text):
        raise InputError(f"{name} {text!r} holds a character that no database keeps")


@dataclass(frozen=True, slots=True, kw_only=True)
class DegreeBox:
    """A closed box of longitudes and latitudes in degrees. Raises InputError if inverted or outside the globe."""

    lon_min_deg: float
    lat_min_deg: float
    lon_max_deg: float
    lat_max_deg: float

    def __post_init__(self) -> None:
        _require_within("longitude", self.lon_min_deg, LON_LIMIT_DEG)
        _require_within("longitude", self.lon_max_deg, LON_LIMIT_DEG)
        _require_within("latitude", self.lat_min_deg, LAT_LIMIT_DEG)
        _require_within("latitude", self.lat_max_deg, LAT_LIMIT_DEG)
        if self.lon_min_deg > self.lon_max_deg:
            raise InputError(f"bbox is inverted: lon_min {self.lon_min_deg} is above lon_max {self.lon_max_deg}")
        if self.lat_min_deg > self.lat_max_deg:
            raise InputError(f"bbox is inverted: lat_min {self.lat_min_deg} is above lat_max {self.lat_max_deg}")

    def contains(self, lat_deg: float, lon_deg: float) -> bool:
        """Whether a position lies in the box or on its edge."""
        return self.lon_min_deg <= lon_deg <= self.lon_max_deg and self.lat_min_deg <= lat_deg <= self.lat_max_deg


@dataclass(frozen=True, slots=True, kw_only=True)
class Disc:
    """All positions within `radius_m` true metres (geodesic, WGS84). Raises InputError if it is none."""

    lat_deg: float
    lon_deg: float
    radius_m: float

    def __post_init__(self) -> None:
        _require_within("latitude", self.lat_deg, LAT_LIMIT_DEG)
        _require_within("longitude", self.lon_deg, LON_LIMIT_DEG)
        if not 0.0 < self.radius_m <= MAX_RADIUS_M:
            raise InputError(f"radius {self.radius_m} m is outside 0 to {MAX_RADIUS_M:g} m")


@dataclass(frozen=True, slots=True, kw_only=True)
class Nearest:
    """The `count` landmarks nearest to a position, however far. Raises InputError if it is none, or too many."""

    lat_deg: float
    lon_deg: float
    count: int

    def __post_init__(self) -> None:
        _require_within("latitude", self.lat_deg, LAT_LIMIT_DEG)
        _require_within("longitude", self.lon_deg, LON_LIMIT_DEG)
        if not 1 <= self.count <= NEAREST_MOST:
            raise InputError(f"nearest {self.count} is outside 1 to {NEAREST_MOST}")


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeSpan:
    """From one time to another in nanoseconds since 1970, both included. Raises InputError if it is inverted."""

    first_ns: int
    last_ns: int

    def __post_init__(self) -> None:
        for name, value_ns in (("first_ns", self.first_ns), ("last_ns", self.last_ns)):
            require_whole(name, value_ns)
        if self.first_ns > self.last_ns:
            raise InputError(f"time span is inverted: first_ns {self.first_ns} is after last_ns {self.last_ns}")

    def meets(self, first_ns: int, last_ns: int) -> bool:
        """Whether another span, both ends included, has a moment in common."""
        return first_ns <= self.last_ns and self.first_ns <= last_ns


@dataclass(frozen=True, slots=True, kw_only=True)
class PageMark:
    """The last landmark of a page, in the order of its answer: by distance where that is asked for, else by id.

    Raises InputError for an id no database keeps, and a distance that is none.
    """

    landmark: str
    distance_m: float | None = None

    def __post_init__(self) -> None:
        _require_text("landmark", self.landmark)
        if self.distance_m is not None and not 0.0 <= self.distance_m < math.inf:
            raise InputError(f"distance {self.distance_m} m is outside 0 to infinity")


@dataclass(frozen=True, slots=True, kw_only=True)
class LandmarkQuery:
    """Which landmarks are asked for: all conditions hold together; None, or no kind, asks for anything.

    `kinds`: one of them. `max_sigma_m`: semi-major axis of the 1-sigma ellipse at most. `vehicle`: one that saw it.
    `seen`: the span from its first to its last sighting meets this one. `as_of` is a map version, None the newest.
    With `near` or `nearest` the answer is in order of distance, else of id; it begins after `after`, and `limit`
    keeps its beginning. Raises InputError for a value outside its limits.
    """

    bbox: DegreeBox | None = None
    near: Disc | None = None
    nearest: Nearest | None = None
    kinds: tuple[str, ...] = ()
    max_sigma_m: float | None = None
    vehicle: str | None = None
    seen: TimeSpan | None = None
    as_of: int | None = None
    limit: int | None = None
    after: PageMark | None = None

    def __post_init__(self) -> None:
        if self.limit is not None and self.limit < 1:
            raise InputError(f"limit {self.limit} is under 1")
        if self.near is not None and self.nearest is not None:
            raise InputError("near and nearest are both asked for: one of them")
        if len(self.kinds) > KINDS_MOST:
            raise InputError(f"{len(self.kinds)} kinds are asked for: at most {KINDS_MOST}")
        if self.max_sigma_m is not None and not 0.0 < self.max_sigma_m <= SIGMA_LIMIT_M:
            raise InputError(f"max_sigma_m {self.max_sigma_m} is outside 0 to {SIGMA_LIMIT_M:g} m")
        if self.as_of is not None:
            require_whole("as_of", self.as_of)
        for kind in self.kinds:
            _require_text("kind", kind, least=0)
        if self.vehicle is not None:
            _require_text("vehicle", self.vehicle)

    @property
    def by_distance(self) -> bool:
        """Whether the answer is in order of distance."""
        return self.near is not None or self.nearest is not None


def box_around(disc: Disc) -> DegreeBox:
    """A box that holds the whole disc, all longitudes where the disc comes near a pole or the antimeridian."""
    lat_reach_deg = disc.radius_m / METRES_PER_DEGREE
    lat_far_deg = min(abs(disc.lat_deg) + lat_reach_deg, LAT_LIMIT_DEG)
    lon_metres = METRES_PER_DEGREE * math.cos(math.radians(lat_far_deg))
    lon_reach_deg = disc.radius_m / lon_metres if lat_far_deg < LAT_LIMIT_DEG else math.inf
    wraps = abs(disc.lon_deg) + lon_reach_deg >= LON_LIMIT_DEG
    return DegreeBox(
        lon_min_deg=-LON_LIMIT_DEG if wraps else disc.lon_deg - lon_reach_deg,
        lat_min_deg=max(disc.lat_deg - lat_reach_deg, -LAT_LIMIT_DEG),
        lon_max_deg=LON_LIMIT_DEG if wraps else disc.lon_deg + lon_reach_deg,
        lat_max_deg=min(disc.lat_deg + lat_reach_deg, LAT_LIMIT_DEG),
    )


def area_box(query: LandmarkQuery) -> DegreeBox | None:
    """A box that holds everything a query can find, None if that is anywhere."""
    if query.near is None:
        return query.bbox
    around = box_around(query.near)
    if query.bbox is None:
        return around
    narrow = around.lon_max_deg - around.lon_min_deg < query.bbox.lon_max_deg - query.bbox.lon_min_deg
    return around if narrow else query.bbox


def require_known_version(map_version: int, known: Sequence[int]) -> None:
    """Raises InputError, naming the known ones, if a map version is not among them."""
    if map_version not in known:
        limits = f"{known[0]} to {known[-1]} are there" if known else "no version is there yet"
        raise InputError(f"map version {map_version} is unknown: {limits}")


def require_next_version(version: MapVersion, held: Sequence[MapVersion]) -> None:
    """Raises InputError if a version does not come after those held, or is in another frame."""
    if not held:
        return
    if version.map_version <= held[-1].map_version:
        raise InputError(f"map version {version.map_version}: {held[-1].map_version} was already applied")
    frame, pinned = _frame_name(version), _frame_name(held[-1])
    if frame != pinned:
        raise InputError(f"map version {version.map_version} is in {frame}: the map is in {pinned}")


def _frame_name(version: MapVersion) -> str:
    return f"{version.crs} from E {version.origin_easting_m} m, N {version.origin_northing_m} m"
