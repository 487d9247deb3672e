"""Rows of the map as GeoJSON features in any of the offered reference systems: the same for every database."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from trigpoint.geodesy.projection import WGS84, transform_coordinates
from trigpoint.landmarks import records
from trigpoint.landmarks.feature_crs import METRE_DECIMALS, FeatureCrs
from trigpoint.landmarks.geojson import JsonObject, landmark_properties
from trigpoint.landmarks.layers import ANCHORS, TRAJECTORIES, Layer, anchor_id, drive_id
from trigpoint.landmarks.model import Anchor, ImageOffset, Landmark, Trajectory

Points = tuple[tuple[float, float], ...]
LayerRow = Landmark | Trajectory | Anchor | ImageOffset


@dataclass(frozen=True)
class MapFeature:
    """A row as a feature: its grid points (easting, northing; one: a point, more: a line, none: no geometry)."""

    feature_id: str
    properties: JsonObject
    grid_m: Points
    row: LayerRow
    map_crs: str
    lon_lat_deg: tuple[float, float] | None = None

    def value(self, name: str) -> Any:
        """The value of a property as it is kept, not as it is shown."""
        return getattr(self.row, name)

    @cached_property
    def degrees(self) -> Points:
        """Its points as longitudes and latitudes."""
        return (self.lon_lat_deg,) if self.lon_lat_deg is not None else _moved(self.grid_m, self.map_crs, WGS84)

    def shape(self) -> BaseGeometry | None:
        """Its geometry in longitudes and latitudes, None without one."""
        if not self.degrees:
            return None
        return Point(self.degrees[0]) if len(self.degrees) == 1 else LineString(self.degrees)

    def grid_shape(self) -> BaseGeometry | None:
        """Its geometry on the grid."""
        if not self.grid_m:
            return None
        return Point(self.grid_m[0]) if len(self.grid_m) == 1 else LineString(self.grid_m)


def _moved(points: Points, source_crs: str, target_crs: str) -> Points:
    if not points:
        return ()
    x, y = np.array(points, dtype=np.float64).T
    x, y = transform_coordinates(x, y, source_crs=source_crs, target_crs=target_crs)
    return tuple(zip(x.tolist(), y.tolist(), strict=True))


def map_feature(row: LayerRow, map_crs: str) -> MapFeature:
    """The feature of a row of a map whose grid is that of `map_crs`."""
    match row:
        case Landmark():
            grid_m = ((row.easting_m, row.northing_m),)
            degrees = (row.lon_deg, row.lat_deg)
            return MapFeature(row.landmark, landmark_properties(row), grid_m, row, map_crs, degrees)
        case Trajectory():
            path = row.path if len(row.path) > 1 else ()
            return MapFeature(drive_id(row.vehicle, row.boot_id), _trajectory_properties(row), path, row, map_crs)
        case Anchor():
            return _anchor_feature(row, map_crs)
        case ImageOffset():
            return MapFeature(row.image, _offset_properties(row), (), row, map_crs)


def features_json(features: Sequence[MapFeature], crs: FeatureCrs) -> bytes:
    """The features as GeoJSON texts with commas between them."""
    return b",".join(json.dumps(_feature(one, crs), ensure_ascii=False).encode() for one in features)


def _feature(feature: MapFeature, crs: FeatureCrs) -> JsonObject:
    return {
        "type": "Feature",
        "id": feature.feature_id,
        "geometry": _geometry(_points_in(feature, crs)),
        "properties": feature.properties,
    }


def _points_in(feature: MapFeature, crs: FeatureCrs) -> list[list[float]]:
    """The feature's points in the order of the system's axes."""
    if crs.crs == feature.map_crs:
        points = feature.grid_m
    elif crs.is_wgs84:
        points = feature.degrees
    else:
        points = _moved(feature.degrees, WGS84, crs.crs)
    ordered = [(y, x) for x, y in points] if crs.north_first else points
    return [[round(first, crs.decimals), round(second, crs.decimals)] for first, second in ordered]


def row_of_record(layer: Layer, record: Mapping[str, object]) -> LayerRow:
    """The row of a record of a layer that is not the landmarks'."""
    if layer is TRAJECTORIES:
        return records.trajectory_of(record)
    return records.anchor_of(record) if layer is ANCHORS else records.image_offset_of(record)


def _geometry(points: list[list[float]]) -> JsonObject | None:
    if not points:
        return None
    return {"type": "Point", "coordinates": points[0]} if len(points) == 1 else _line(points)


def _line(points: list[list[float]]) -> JsonObject:
    return {"type": "LineString", "coordinates": points}


def _trajectory_properties(row: Trajectory) -> JsonObject:
    return {
        "vehicle": row.vehicle,
        "boot_id": row.boot_id,
        "map_version": row.map_version,
        "first_stamp_ns": row.first_stamp_ns,
        "last_stamp_ns": row.last_stamp_ns,
        "pose_count": row.pose_count,
        "length_m": round(row.length_m, METRE_DECIMALS),
        "calibration": json.loads(row.calibration_json),
    }


def _anchor_feature(row: Anchor, map_crs: str) -> MapFeature:
    placed = row.easting_m is not None and row.northing_m is not None
    degrees = row.lon_deg is not None and row.lat_deg is not None
    return MapFeature(
        anchor_id(row.anchor, row.image),
        _anchor_properties(row),
        ((row.easting_m, row.northing_m),) if placed else (),  # type: ignore[arg-type]  # neither is None here
        row,
        map_crs,
        (row.lon_deg, row.lat_deg) if placed and degrees else None,  # type: ignore[arg-type]  # nor here
    )


def _anchor_properties(row: Anchor) -> JsonObject:
    return {
        "anchor": row.anchor,
        "image": row.image,
        "kind": row.kind,
        "signature": row.signature,
        "landmark": row.landmark,
        "reason": row.reason,
        "sigma_m": row.sigma_m,
        "residual_x_m": row.residual_x_m,
        "residual_y_m": row.residual_y_m,
        "residual_m": row.residual_m,
        "easting_m": row.easting_m,
        "northing_m": row.northing_m,
        "map_version": row.map_version,
    }


def _offset_properties(row: ImageOffset) -> JsonObject:
    return {
        "image": row.image,
        "offset_x_m": row.offset_x_m,
        "offset_y_m": row.offset_y_m,
        "covariance_m2": [[row.variance_x_m2, row.covariance_xy_m2], [row.covariance_xy_m2, row.variance_y_m2]],
        "map_version": row.map_version,
    }
