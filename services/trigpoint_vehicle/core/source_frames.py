"""Where a source's coordinates lie on the Earth, and its headings on the map's grid."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import FrameRefused
from trigpoint.geodesy.positions import GridPosition, Wgs84Position
from trigpoint.geodesy.projection import WGS84, is_geographic, pin_map_frame, transform_coordinates

Floats = NDArray[np.float64]

WGS84_SEMI_MAJOR_M = 6_378_137.0
WGS84_ECCENTRICITY_SQUARED = 6.69437999014e-3
HEADING_STEP_M = 1.0  # a heading is carried over by the two ends of a step of this length


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceFrame:
    """Coordinates of a source: `crs` position = offset + scale * source position, x or longitude first."""

    crs: str
    in_degrees: bool = False
    offset_x_m: float = 0.0
    offset_y_m: float = 0.0
    scale: float = 1.0


def geographic_frame(crs: str = WGS84) -> SourceFrame:
    """Longitudes and latitudes in degrees; headings from true east."""
    return SourceFrame(crs=crs, in_degrees=True)


def projected_frame(crs: str) -> SourceFrame:
    """Eastings and northings of a projected CRS in metres; headings from grid east."""
    return SourceFrame(crs=crs)


def local_frame_on_grid(crs: str, origin: GridPosition) -> SourceFrame:
    """Metres on the ground from an origin, axes parallel to the grid of `crs`. Raises FrameRefused."""
    scale = pin_map_frame(crs=crs, origin=origin).point_scale
    return SourceFrame(crs=crs, offset_x_m=origin.easting_m, offset_y_m=origin.northing_m, scale=scale)


def local_frame_at(origin: Wgs84Position) -> SourceFrame:
    """Metres on the ground from an origin, axes to its true east and north (azimuthal equidistant).

    Raises FrameRefused.
    """
    if not (abs(origin.lat_deg) <= 90.0 and abs(origin.lon_deg) <= 180.0):
        raise FrameRefused(f"local origin {origin.lat_deg}, {origin.lon_deg} is not on the Earth")
    projection = f"+proj=aeqd +lat_0={origin.lat_deg!r} +lon_0={origin.lon_deg!r} +datum=WGS84 +units=m +type=crs"
    return SourceFrame(crs=projection)


def wgs84_from_source(x: Floats, y: Floats, frame: SourceFrame) -> tuple[Floats, Floats]:
    """Latitudes and longitudes (n,) in degrees of source coordinates (n,). NaN stays NaN. Raises FrameRefused."""
    lat_deg, lon_deg = np.full(x.shape, np.nan), np.full(x.shape, np.nan)
    known = np.isfinite(x) & np.isfinite(y)
    crs_x, crs_y = frame.offset_x_m + frame.scale * x[known], frame.offset_y_m + frame.scale * y[known]
    if frame.in_degrees != is_geographic(frame.crs):
        raise FrameRefused(f"CRS {frame.crs!r} is {'not ' if frame.in_degrees else ''}one of latitude and longitude")
    if frame.crs == WGS84:
        lat_deg[known], lon_deg[known] = crs_y, crs_x
    elif known.any():
        if not frame.in_degrees:
            pin_map_frame(crs=frame.crs, origin=GridPosition(float(crs_x[0]), float(crs_y[0])))
        lon_deg[known], lat_deg[known] = transform_coordinates(crs_x, crs_y, source_crs=frame.crs, target_crs=WGS84)
    return lat_deg, lon_deg


def _step(y: Floats, heading_rad: Floats, frame: SourceFrame) -> tuple[Floats, Floats]:
    east, north = HEADING_STEP_M * np.cos(heading_rad), HEADING_STEP_M * np.sin(heading_rad)
    if not frame.in_degrees:
        return east, north
    lat_rad = np.radians(y)
    squeezed = 1.0 - WGS84_ECCENTRICITY_SQUARED * np.sin(lat_rad) ** 2
    prime_vertical_m = WGS84_SEMI_MAJOR_M / np.sqrt(squeezed)
    meridian_m = prime_vertical_m * (1.0 - WGS84_ECCENTRICITY_SQUARED) / squeezed
    return np.degrees(east / (prime_vertical_m * np.cos(lat_rad))), np.degrees(north / meridian_m)


def grid_headings_rad(x: Floats, y: Floats, heading_rad: Floats, frame: SourceFrame, *, map_crs: str) -> Floats:
    """Headings (n,) counter-clockwise from grid east of `map_crs`, from headings counter-clockwise from the source
    frame's own east at source coordinates (n,). NaN stays NaN. Raises FrameRefused."""
    grid_rad = np.full(x.shape, math.nan)
    known = np.isfinite(x) & np.isfinite(y) & np.isfinite(heading_rad)
    if not known.any():
        return grid_rad
    ahead_x, ahead_y = _step(y[known], heading_rad[known], frame)
    here_lat, here_lon = wgs84_from_source(x[known], y[known], frame)
    there_lat, there_lon = wgs84_from_source(x[known] + ahead_x, y[known] + ahead_y, frame)
    here = transform_coordinates(here_lon, here_lat, source_crs=WGS84, target_crs=map_crs)
    there = transform_coordinates(there_lon, there_lat, source_crs=WGS84, target_crs=map_crs)
    grid_rad[known] = np.arctan2(there[1] - here[1], there[0] - here[0])
    return grid_rad
