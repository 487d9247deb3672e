"""Map frame and the changes between WGS84, grid and map positions; pyproj's one home."""

import math
import warnings
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Geod, Proj, Transformer
from pyproj.exceptions import CRSError, ProjError
from pyproj.transformer import TransformerGroup

from trigpoint.errors import FrameRefused
from trigpoint.geodesy.positions import GridPosition, MapPosition, Wgs84Position

Floats = NDArray[np.float64]

WGS84 = "EPSG:4326"
WGS84_NAME = "World Geodetic System 1984"  # its ensemble counts as dynamic (IOGP 373-7-1): its realisations are
ORIGIN_ROUNDING_M = 1000.0  # a map's origin is a round grid position: a person can read it


@dataclass(frozen=True, slots=True, kw_only=True)
class MapFrame:
    """A map's pinned frame: x east and y north along the grid of `crs`, in metres from the origin.

    `point_scale` is grid metres for one metre on the ground at the origin, `convergence_rad` the
    angle from true north to grid north, clockwise positive (Snyder 1987, ch. 8).
    """

    crs: str
    origin_easting_m: float
    origin_northing_m: float
    point_scale: float
    convergence_rad: float
    operation: str
    operation_accuracy_m: float


def _parsed_crs(crs: str) -> CRS:
    try:
        return CRS.from_user_input(crs)
    except CRSError as error:
        raise FrameRefused(f"CRS {crs!r} is not known: {error}") from error


@lru_cache(maxsize=64)
def _transformer(source_crs: str, target_crs: str) -> Transformer:
    # PROJ contexts must not be shared between threads: pyproj's Transformer (since 3.1) keeps one a thread itself.
    source, target = _parsed_crs(source_crs), _parsed_crs(target_crs)
    try:
        return Transformer.from_crs(source, target, always_xy=True)
    except ProjError as error:
        raise FrameRefused(f"nothing leads from {source_crs} to {target_crs}: {error}") from error


def _operations(source: CRS, target: CRS) -> TransformerGroup:
    """All operations between two CRS, the best first. Raises FrameRefused where there is none."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that a better one needs a grid: the group says so itself
        group = TransformerGroup(source, target, always_xy=True)
    if not group.transformers:
        raise FrameRefused(f"nothing leads from {source.to_string()} to {target.to_string()}")
    return group


def transform_coordinates(x: Floats, y: Floats, *, source_crs: str, target_crs: str) -> tuple[Floats, Floats]:
    """Coordinates (n,) in `target_crs`, always x or longitude first.

    Raises FrameRefused for an unknown CRS or a position outside the projection's domain.
    """
    transformer = _transformer(source_crs, target_crs)
    try:
        out_x, out_y = transformer.transform(np.asarray(x, float), np.asarray(y, float), errcheck=True)
    except ProjError as error:
        raise FrameRefused(f"a position cannot be taken from {source_crs} into {target_crs}: {error}") from error
    return np.asarray(out_x, dtype=np.float64), np.asarray(out_y, dtype=np.float64)


@lru_cache(maxsize=64)
def transformation_between(*, source_crs: str, target_crs: str) -> str:
    """The best operation between two CRS by PROJ's own description, with its accuracy in metres where it is known.

    Raises FrameRefused for an unknown CRS, and for one that has no known relation to the other.
    """
    source, target = _parsed_crs(source_crs), _parsed_crs(target_crs)
    if not (source.is_geographic or source.is_projected):
        raise FrameRefused(f"CRS {source_crs!r} is {source.type_name}: a geographic or projected CRS is needed")
    group = _operations(source, target)
    best = group.transformers[0]
    accuracy = f", accuracy {best.accuracy:g} m" if best.accuracy >= 0.0 else ""
    return f"{best.description}{accuracy}{'' if group.best_available else ', a better one needs a grid not installed'}"


def is_geographic(crs: str) -> bool:
    """Whether a CRS gives latitude and longitude. Raises FrameRefused if it is not known."""
    return bool(_parsed_crs(crs).is_geographic)


def is_north_first(crs: str) -> bool:
    """Whether a CRS's own first axis is that to the north. Raises FrameRefused if it is not known."""
    axes = _parsed_crs(crs).axis_info
    return bool(axes) and axes[0].direction == "north"


def utm_crs(position: Wgs84Position) -> str:
    """The EPSG name of the UTM zone a position lies in."""
    zone = int(math.floor((position.lon_deg + 180.0) / 6.0)) % 60 + 1
    return f"EPSG:{(32600 if position.lat_deg >= 0.0 else 32700) + zone}"


def pin_map_frame(*, crs: str, origin: GridPosition) -> MapFrame:
    """The map frame of a projected CRS and an origin.

    Raises FrameRefused if `crs` is not projected in metres or has no known relation to WGS84.
    """
    parsed = _parsed_crs(crs)
    if not parsed.is_projected or any(abs(axis.unit_conversion_factor - 1.0) > 0.0 for axis in parsed.axis_info[:2]):
        raise FrameRefused(f"CRS {crs!r} is {parsed.type_name}: a map needs a projected CRS in metres")
    best = _operations(_parsed_crs(WGS84), parsed).transformers[0]
    lon_deg, lat_deg = transform_coordinates(
        np.array([origin.easting_m]), np.array([origin.northing_m]), source_crs=crs, target_crs=WGS84
    )
    factors = Proj(parsed).get_factors(lon_deg[0], lat_deg[0])
    return MapFrame(
        crs=crs,
        origin_easting_m=origin.easting_m,
        origin_northing_m=origin.northing_m,
        point_scale=math.sqrt(float(factors.meridional_scale) * float(factors.parallel_scale)),
        convergence_rad=math.radians(float(factors.meridian_convergence)),
        operation=best.description,
        operation_accuracy_m=float(best.accuracy),
    )


def pin_map_frame_at(position: Wgs84Position) -> MapFrame:
    """The map frame of the UTM zone around a first position, its origin rounded down to whole kilometres."""
    crs = utm_crs(position)
    easting_m, northing_m = transform_coordinates(
        np.array([position.lon_deg]), np.array([position.lat_deg]), source_crs=WGS84, target_crs=crs
    )
    origin = GridPosition(
        math.floor(easting_m[0] / ORIGIN_ROUNDING_M) * ORIGIN_ROUNDING_M,
        math.floor(northing_m[0] / ORIGIN_ROUNDING_M) * ORIGIN_ROUNDING_M,
    )
    return pin_map_frame(crs=crs, origin=origin)


def map_points_from_wgs84(lat_deg: Floats, lon_deg: Floats, frame: MapFrame) -> Floats:
    """Map positions (n, 2): x, y in metres, of latitudes and longitudes (n,) in degrees."""
    easting_m, northing_m = transform_coordinates(lon_deg, lat_deg, source_crs=WGS84, target_crs=frame.crs)
    return np.column_stack([easting_m - frame.origin_easting_m, northing_m - frame.origin_northing_m])


def wgs84_from_map_points(point_m: Floats, frame: MapFrame) -> tuple[Floats, Floats]:
    """Latitudes and longitudes (n,) in degrees of map positions (n, 2): x, y in metres."""
    lon_deg, lat_deg = transform_coordinates(
        point_m[:, 0] + frame.origin_easting_m,
        point_m[:, 1] + frame.origin_northing_m,
        source_crs=frame.crs,
        target_crs=WGS84,
    )
    return lat_deg, lon_deg


def map_from_wgs84(position: Wgs84Position, frame: MapFrame) -> MapPosition:
    """One position in the map frame."""
    point_m = map_points_from_wgs84(np.array([position.lat_deg]), np.array([position.lon_deg]), frame)[0]
    return MapPosition(float(point_m[0]), float(point_m[1]))


def wgs84_from_map(position: MapPosition, frame: MapFrame) -> Wgs84Position:
    """One position in degrees."""
    lat_deg, lon_deg = wgs84_from_map_points(np.array([[position.x_m, position.y_m]]), frame)
    return Wgs84Position(float(lat_deg[0]), float(lon_deg[0]))


@dataclass(frozen=True, slots=True)
class CrsDefinition:
    """What a GIS file says of a CRS: its name, its code at an authority ("" and 0 without one), and its WKT 1."""

    name: str
    authority: str
    code: int
    wkt: str


def crs_definition(crs: str) -> CrsDefinition:
    """The definition of a CRS, as WKT 1 in GDAL's dialect. Raises FrameRefused for a CRS unknown or without WKT 1."""
    parsed = _parsed_crs(crs)
    try:
        wkt = parsed.to_wkt("WKT1_GDAL")
    except CRSError as error:
        raise FrameRefused(f"CRS {crs!r} has no WKT 1: {error}") from error
    authority, code = parsed.to_authority() or ("", "0")
    return CrsDefinition(parsed.name, authority, int(code) if code.isdecimal() else 0, wkt)


def crs_unit(crs: str) -> Literal["deg", "m"]:
    """The unit of a CRS's horizontal axes. Raises FrameRefused for one that is unknown, or in any other unit."""
    parsed = _parsed_crs(crs)
    units = {axis.unit_name for axis in parsed.axis_info[:2]}
    if parsed.is_geographic and units == {"degree"}:
        return "deg"
    if parsed.is_projected and units == {"metre"}:
        return "m"
    raise FrameRefused(f"CRS {crs!r} is {parsed.type_name} in {'/'.join(sorted(units))}: degrees or metres are needed")


def needs_epoch(crs: str) -> bool:
    """Whether the ground moves in a CRS, so that a position says little without its epoch (ISO 19111: dynamic)."""
    geodetic = _parsed_crs(crs).geodetic_crs
    described: dict[str, Any] = {} if geodetic is None else geodetic.to_json_dict()
    datum = described.get("datum") or described.get("datum_ensemble") or {}
    return datum.get("type") == "DynamicGeodeticReferenceFrame" or WGS84_NAME in datum.get("name", "")


def crs_projjson(crs: str) -> dict[str, Any]:
    """The definition of a CRS as PROJJSON. Raises FrameRefused if it is not known."""
    return _parsed_crs(crs).to_json_dict()


def crs_wkt2(crs: str) -> str:
    """The definition of a CRS as WKT 2 (ISO 19162:2019). Raises FrameRefused if it is not known."""
    return str(_parsed_crs(crs).to_wkt("WKT2_2019"))


def geodesic_distances_m(from_lat_deg: float, from_lon_deg: float, *, lat_deg: Floats, lon_deg: Floats) -> Floats:
    """True metres (n,) on the WGS84 ellipsoid from one position to others (n,), in degrees (Karney 2013)."""
    here_lon_deg, here_lat_deg = np.full(len(lat_deg), from_lon_deg), np.full(len(lat_deg), from_lat_deg)
    _, _, distance_m = Geod(ellps="WGS84").inv(here_lon_deg, here_lat_deg, lon_deg, lat_deg)
    return np.asarray(distance_m, dtype=np.float64)
