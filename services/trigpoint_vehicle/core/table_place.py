"""Where a manifest's drives take place: the frame they declare, and the grid their map will have."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from trigpoint.errors import InputError
from trigpoint.geodesy.positions import GridPosition, Wgs84Position
from trigpoint.geodesy.projection import ORIGIN_ROUNDING_M, WGS84, transform_coordinates, utm_crs
from trigpoint_vehicle.core.table_manifest import PositionPart, Vehicle
from trigpoint_vehicle.core.table_reading import Reading, positions


@dataclass(frozen=True, slots=True)
class DeclaredPlace:
    """A projected CRS and an origin on its grid."""

    crs: str
    origin: GridPosition


def _first_position(reading: Reading, part: PositionPart, vehicle: Vehicle | None = None) -> Wgs84Position | None:
    lat_deg, lon_deg = positions(part, reading.table(part, vehicle), reading.frame(part))
    known = np.flatnonzero(np.isfinite(lat_deg))
    return Wgs84Position(float(lat_deg[known[0]]), float(lon_deg[known[0]])) if len(known) else None


def _measured_positions(reading: Reading) -> Iterator[Wgs84Position | None]:
    for vehicle in reading.manifest.vehicle:
        yield from (_first_position(reading, part, vehicle) for part in vehicle.fixes)
    yield from (_first_position(reading, part) for part in reading.manifest.anchors)


def _true_positions(reading: Reading) -> Iterator[Wgs84Position | None]:
    for vehicle in reading.manifest.vehicle:
        yield from (_first_position(reading, part, vehicle) for part in vehicle.true_path)


def _rounded_origin(crs: str, position: Wgs84Position) -> GridPosition:
    easting_m, northing_m = transform_coordinates(
        np.array([position.lon_deg]), np.array([position.lat_deg]), source_crs=WGS84, target_crs=crs
    )
    return GridPosition(
        math.floor(easting_m[0] / ORIGIN_ROUNDING_M) * ORIGIN_ROUNDING_M,
        math.floor(northing_m[0] / ORIGIN_ROUNDING_M) * ORIGIN_ROUNDING_M,
    )


def declared_place(reading: Reading) -> DeclaredPlace | None:
    """What the drives shall declare: `map_crs` near the first fix or anchor, or the grid of a local frame; else None.

    Raises InputError for a `map_crs` without any position, FrameRefused for one that is not known.
    """
    manifest = reading.manifest
    on_grid = manifest.frame.on_grid if manifest.frame.kind == "local" else None
    if on_grid is not None and manifest.map_crs in ("", manifest.frame.crs):
        return DeclaredPlace(manifest.frame.crs, on_grid)
    if not manifest.map_crs:
        return None
    first = next((position for position in _measured_positions(reading) if position), None)
    if first is None:
        raise InputError(f"map_crs {manifest.map_crs!r} is given, but no fix and no anchor says where the map is")
    return DeclaredPlace(manifest.map_crs, _rounded_origin(manifest.map_crs, first))


def expected_map_crs(reading: Reading, place: DeclaredPlace | None) -> str:
    """The CRS the map will have: the declared one, or the UTM zone of the first position; empty without any."""
    if place is not None:
        return place.crs
    found = (position for source in (_measured_positions, _true_positions) for position in source(reading))
    first = next((position for position in found if position), None)
    return utm_crs(first) if first else ""
