"""What can be asked of a landmark map, checked before it is asked."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from trigpoint.errors import InputError
from trigpoint.geodesy.projection import geodesic_distances_m
from trigpoint.landmarks.model import Landmark, LandmarkChanges, MapVersion, changes_between

METRES_PER_DEGREE = 110_574.0  # of latitude, at the equator, where WGS84 has the fewest; of longitude times cos(lat)
LAT_LIMIT_DEG = 90.0
LON_LIMIT_DEG = 180.0
MAX_RADIUS_M = 100_000.0  # a landmark map is a district's, not a continent's


def _require_within(name: str, value: float, limit: float) -> None:
    if not abs(value) <= limit:
        raise InputError(f"{name} {value} is outside -{limit:g} to {limit:g}")


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
class LandmarkQuery:
    """Which landmarks are asked for: all conditions hold together; None asks for anything.

    `as_of` is a map version, None the newest. With `near` the answer is in order of distance, else of id;
    `limit` keeps its beginning. Raises InputError for a limit under 1.
    """

    bbox: DegreeBox | None = None
    near: Disc | None = None
    kind: str | None = None
    as_of: int | None = None
    limit: int | None = None

    def __post_init__(self) -> None:
        if self.limit is not None and self.limit < 1:
            raise InputError(f"limit {self.limit} is under 1")


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


def answered(found: Sequence[Landmark], query: LandmarkQuery) -> tuple[Landmark, ...]:
    """The answer to a query from landmarks that meet its kind and version, and its area at least nearly."""
    boxed = [landmark for landmark in found if query.bbox is None or _inside(landmark, query.bbox)]
    if query.near is None:
        ordered = sorted(boxed, key=lambda landmark: landmark.landmark)
    else:
        ordered = _nearest_within(boxed, query.near)
    return tuple(ordered[: query.limit])


def _inside(landmark: Landmark, bbox: DegreeBox) -> bool:
    return bbox.contains(landmark.lat_deg, landmark.lon_deg)


def _nearest_within(landmarks: list[Landmark], disc: Disc) -> list[Landmark]:
    """Those inside the disc, nearest first, then by id."""
    if not landmarks:
        return []
    distance_m = geodesic_distances_m(
        disc.lat_deg,
        disc.lon_deg,
        lat_deg=np.array([landmark.lat_deg for landmark in landmarks]),
        lon_deg=np.array([landmark.lon_deg for landmark in landmarks]),
    )
    inside = [pair for pair in zip(distance_m.tolist(), landmarks, strict=True) if pair[0] <= disc.radius_m]
    return [landmark for _, landmark in sorted(inside, key=lambda pair: (pair[0], pair[1].landmark))]


class _Answering(Protocol):
    def landmarks(self, query: LandmarkQuery) -> tuple[Landmark, ...]: ...

    def map_versions(self) -> tuple[MapVersion, ...]: ...


def changes_of(store: _Answering, query: LandmarkQuery, *, since: int) -> LandmarkChanges:
    """The changes a store answers, from its two answers to the query. Raises InputError as `LandmarkStore.changes`."""
    if query.limit is not None:
        raise InputError(f"limit {query.limit} cannot go with changes since version {since}: they are whole or wrong")
    known = tuple(version.map_version for version in store.map_versions())
    require_known_version(since, known)
    as_of = known[-1] if query.as_of is None else query.as_of
    before = store.landmarks(replace(query, as_of=since))
    after = store.landmarks(replace(query, as_of=as_of))
    return changes_between(before, after, since=since, as_of=as_of)


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
