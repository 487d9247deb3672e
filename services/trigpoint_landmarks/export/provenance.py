"""Where an exported map comes from, as every format carries it."""

import calendar
import math
from dataclasses import asdict, dataclass
from datetime import UTC, datetime

from trigpoint.geodesy.projection import needs_epoch
from trigpoint.landmarks.feature_crs import CRS84, FeatureCrs
from trigpoint.landmarks.geojson import JsonObject
from trigpoint.landmarks.model import MapVersion
from trigpoint.landmarks.queries import TimeSpan

NS_PER_S = 1e9
EPOCH_DECIMALS = 3  # a thousandth of a year, in which no plate moves by 0.2 mm


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """What a map version is, and in what its positions are given.

    `crs` is that of the file, `map_crs` the one the map was solved in. `coordinate_epoch` is a decimal year: the middle
    of all observations; None where the ground stands still in the map's CRS or nothing was observed. Covariances are
    along the grid axes of `map_crs`, whatever `crs` is. `operation_accuracy_m` is None where it is not known.
    """

    map_version: int
    method: str
    solved_ns: int
    crs: str
    map_crs: str
    origin_easting_m: float
    origin_northing_m: float
    operation: str
    operation_accuracy_m: float | None
    coordinate_epoch: float | None
    first_seen_ns: int | None
    last_seen_ns: int | None
    generator: str

    def values(self) -> JsonObject:
        """It as JSON."""
        return asdict(self)


def provenance_of(version: MapVersion, crs: FeatureCrs, seen: TimeSpan | None, *, generator: str) -> Provenance:
    """The provenance of a map version in a file's CRS; `seen` spans its observations."""
    known = math.isfinite(version.operation_accuracy_m) and version.operation_accuracy_m >= 0.0
    moving = needs_epoch(version.crs) and needs_epoch(crs.crs)
    return Provenance(
        map_version=version.map_version,
        method=version.method,
        solved_ns=version.solved_ns,
        crs=crs_name(crs),
        map_crs=version.crs,
        origin_easting_m=version.origin_easting_m,
        origin_northing_m=version.origin_northing_m,
        operation=version.operation,
        operation_accuracy_m=version.operation_accuracy_m if known else None,
        coordinate_epoch=decimal_year((seen.first_ns + seen.last_ns) // 2) if moving and seen is not None else None,
        first_seen_ns=None if seen is None else seen.first_ns,
        last_seen_ns=None if seen is None else seen.last_ns,
        generator=generator,
    )


def crs_name(crs: FeatureCrs) -> str:
    """The name a CRS is asked for by."""
    return "OGC:CRS84" if crs == CRS84 else crs.crs


def decimal_year(stamp_ns: int) -> float:
    """A time (ns since 1970, UTC) as a year with its part that has passed."""
    at = datetime.fromtimestamp(stamp_ns / NS_PER_S, tz=UTC)
    begin = datetime(at.year, 1, 1, tzinfo=UTC)
    days = 366 if calendar.isleap(at.year) else 365
    return round(at.year + (at - begin).total_seconds() / (86_400.0 * days), EPOCH_DECIMALS)
