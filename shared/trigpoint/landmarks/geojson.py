"""Landmarks as JSON and as GeoJSON (RFC 7946): plain values, ready for a JSON encoder; the same keys everywhere."""

from collections.abc import Sequence

from trigpoint.landmarks.model import Landmark, LandmarkChanges

DEGREE_DECIMALS = 9  # 0.1 mm on the ground
METRE_DECIMALS = 4

JsonObject = dict[str, object]
Coordinates = tuple[float, float]


def feature_collection(landmarks: Sequence[Landmark], *, map_version: int | None) -> JsonObject:
    """The landmarks as a GeoJSON FeatureCollection; coordinates are longitude, latitude on WGS84."""
    return {
        "type": "FeatureCollection",
        "map_version": map_version,
        "features": [landmark_feature(landmark) for landmark in landmarks],
    }


def landmark_feature(landmark: Landmark, *, coordinates: Coordinates | None = None) -> JsonObject:
    """The landmark as a GeoJSON Feature at `coordinates` (x or longitude first), if not in WGS84 degrees."""
    wgs84 = (round(landmark.lon_deg, DEGREE_DECIMALS), round(landmark.lat_deg, DEGREE_DECIMALS))
    return {
        "type": "Feature",
        "id": landmark.landmark,
        "geometry": {"type": "Point", "coordinates": list(coordinates or wgs84)},
        "properties": landmark_properties(landmark),
    }


def landmark_list(landmarks: Sequence[Landmark], *, map_version: int | None) -> JsonObject:
    """The landmarks as one JSON object: {map_version, landmarks: {count, items}}."""
    items = [_position(landmark) | landmark_properties(landmark) for landmark in landmarks]
    return {"map_version": map_version, "landmarks": {"count": len(items), "items": items}}


def change_list(changes: LandmarkChanges) -> JsonObject:
    """What changed since a version: {since, map_version, changed: {count, items}, removed: {count, items}}."""
    items = [_position(landmark) | landmark_properties(landmark) for landmark in changes.changed]
    return {
        "since": changes.since,
        "map_version": changes.as_of,
        "changed": {"count": len(items), "items": items},
        "removed": {"count": len(changes.removed), "items": list(changes.removed)},
    }


def _position(landmark: Landmark) -> JsonObject:
    return {
        "lat_deg": round(landmark.lat_deg, DEGREE_DECIMALS),
        "lon_deg": round(landmark.lon_deg, DEGREE_DECIMALS),
    }


def landmark_properties(landmark: Landmark) -> JsonObject:
    """What is said of a landmark besides where it is in degrees; each quantity's key ends with its unit."""
    return {
        "landmark": landmark.landmark,
        "kind": landmark.kind,
        "signature": landmark.signature,
        "x_m": round(landmark.x_m, METRE_DECIMALS),
        "y_m": round(landmark.y_m, METRE_DECIMALS),
        "easting_m": round(landmark.easting_m, METRE_DECIMALS),
        "northing_m": round(landmark.northing_m, METRE_DECIMALS),
        "covariance_m2": [
            [landmark.variance_x_m2, landmark.covariance_xy_m2],
            [landmark.covariance_xy_m2, landmark.variance_y_m2],
        ],
        "sigma_major_m": round(landmark.sigma_major_m, METRE_DECIMALS),
        "sigma_minor_m": round(landmark.sigma_minor_m, METRE_DECIMALS),
        "ellipse_heading_rad": landmark.ellipse_heading_rad,
        "observation_count": landmark.observation_count,
        "vehicles": list(landmark.vehicles),
        "first_seen_ns": landmark.first_seen_ns,
        "last_seen_ns": landmark.last_seen_ns,
        "anchored": landmark.anchored,
        "anchors": list(landmark.anchors),
        "valid_from_version": landmark.valid_from_version,
        "valid_to_version": landmark.valid_to_version,
    }
