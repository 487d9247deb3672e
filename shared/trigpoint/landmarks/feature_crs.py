"""The reference systems features are given in, by their OGC names, each with its own order of axes."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.geodesy.projection import (
    WGS84,
    crs_definition,
    is_geographic,
    is_north_first,
    transform_coordinates,
)

Floats = NDArray[np.float64]

CRS84_URI = "http://www.opengis.net/def/crs/OGC/1.3/CRS84"
EPSG_URI = "http://www.opengis.net/def/crs/EPSG/0/"
WEB_MERCATOR = "EPSG:3857"
DEGREE_DECIMALS = 9  # 0.1 mm on the ground
METRE_DECIMALS = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class FeatureCrs:
    """A reference system: `crs` as PROJ knows it; `north_first` where its first axis is the one to the north."""

    uri: str
    crs: str
    north_first: bool
    in_degrees: bool

    @property
    def decimals(self) -> int:
        """How many digits of a coordinate after the point say something."""
        return DEGREE_DECIMALS if self.in_degrees else METRE_DECIMALS

    @property
    def is_wgs84(self) -> bool:
        """Whether its coordinates are degrees on WGS84, in whatever order."""
        return self.crs == WGS84


CRS84 = FeatureCrs(uri=CRS84_URI, crs=WGS84, north_first=False, in_degrees=True)


@lru_cache(maxsize=16)
def offered_crs(map_crs: str) -> tuple[FeatureCrs, ...]:
    """What the features of a map can be had in; the last is that in which the map is kept, if it has a name."""
    offered = [CRS84, _epsg(4326), _epsg(3857)]
    known = crs_definition(map_crs)
    if known.authority == "EPSG" and known.code not in (4326, 3857):
        offered.append(_epsg(known.code))
    return tuple(offered)


def storage_crs(map_crs: str) -> FeatureCrs:
    """The reference system a map is kept in; CRS84 for one without a name, whose degrees are kept too."""
    last = offered_crs(map_crs)[-1]
    return last if last.crs != WEB_MERCATOR else CRS84


def crs_of_uri(uri: str, map_crs: str) -> FeatureCrs:
    """The reference system of a URI. Raises InputError, naming those there are."""
    offered = offered_crs(map_crs)
    found = [one for one in offered if one.uri == uri]
    if not found:
        raise InputError(f"crs {uri[:100]!r} is not offered: there are {', '.join(one.uri for one in offered)}")
    return found[0]


def _epsg(code: int) -> FeatureCrs:
    crs = f"EPSG:{code}"
    return FeatureCrs(uri=f"{EPSG_URI}{code}", crs=crs, north_first=is_north_first(crs), in_degrees=is_geographic(crs))


def degrees_of(crs: FeatureCrs, first: Floats, second: Floats) -> tuple[Floats, Floats]:
    """Longitudes and latitudes (n,) of coordinates (n,) in the order of the system's axes.

    Raises InputError for a position outside the system's domain.
    """
    x, y = (second, first) if crs.north_first else (first, second)
    if crs.is_wgs84:
        return x, y
    return transform_coordinates(x, y, source_crs=crs.crs, target_crs=WGS84)
