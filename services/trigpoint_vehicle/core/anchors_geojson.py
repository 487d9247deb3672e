"""Anchors as GeoJSON (RFC 7946): points in WGS84 degrees, longitude first."""

import json
from collections.abc import Iterable

from trigpoint.events.corrected import AnchorLabelled

DEGREE_DECIMALS = 11  # about a micrometre


def _feature(anchor: AnchorLabelled) -> str:
    properties = {
        "anchor": anchor.anchor,
        "image": anchor.image,
        "sigma_m": anchor.sigma_m,
        "image_sigma_m": anchor.image_sigma_m,
        "kind": anchor.kind,
        "signature": anchor.signature,
    }
    position = [round(anchor.lon_deg, DEGREE_DECIMALS), round(anchor.lat_deg, DEGREE_DECIMALS)]
    geometry = {"type": "Point", "coordinates": position}
    return json.dumps({"type": "Feature", "geometry": geometry, "properties": properties})


def anchors_geojson(anchors: Iterable[AnchorLabelled]) -> str:
    """A feature collection, one anchor a line."""
    features = ",\n".join(_feature(anchor) for anchor in anchors)
    return f'{{"type": "FeatureCollection", "features": [\n{features}\n]}}\n'
