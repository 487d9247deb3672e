"""A small map with anchors: landmarks in a row, some of them labelled in an image that is off by a known offset."""

from dataclasses import replace

import numpy as np

from landmark_maps.examples import ORIGIN, change, frame, landmark
from map_features.examples import gain, offset
from trigpoint.geodesy.positions import MapPosition
from trigpoint.geodesy.projection import wgs84_from_map
from trigpoint.landmarks.model import Anchor, Landmark, MapChange
from trigpoint_optimisation.settings import SolveSettings, settings_json

PLACES_M = {"L0": (0.0, 0.0), "L1": (1.2, 0.0), "L2": (20.0, 0.0), "L3": (40.0, 0.0), "L4": (40.0, 30.0)}
LABELLED = ("L2", "L3", "L4")
OFFSET_M = (0.2, -0.1)  # of the image tile-1


def degrees(x_m: float, y_m: float) -> tuple[float, float]:
    """Latitude and longitude of a place in the map frame."""
    at = wgs84_from_map(MapPosition(x_m, y_m), frame())
    return at.lat_deg, at.lon_deg


def anchored_version(map_version: int = 1, *, tied: bool = True) -> MapChange:
    """A version solved whole with a label on each landmark that is labelled, or with labels none of which is tied."""
    rows = [_landmark(name, name in LABELLED and tied) for name in PLACES_M]
    anchors = tuple(_anchor(f"a{number}", name, tied=tied) for number, name in enumerate(LABELLED))
    whole = change(map_version, opened=rows)
    return replace(
        whole,
        version=replace(whole.version, settings_json=settings_json(SolveSettings())),
        anchors=tuple(replace(one, map_version=map_version) for one in anchors),
        image_offsets=(offset(map_version=map_version),),
        label_gains=tuple(replace(gain(image, *PLACES_M), map_version=map_version) for image in ("", "tile-1")),
    )


def _landmark(name: str, anchored: bool) -> Landmark:
    row = landmark(name, *PLACES_M[name])
    return row._replace(anchored=anchored, anchors=(), signature="gate" if name == "L3" else "")


def _anchor(name: str, of: str, *, tied: bool) -> Anchor:
    x_m, y_m = np.add(PLACES_M[of], OFFSET_M).tolist()
    lat_deg, lon_deg = degrees(x_m, y_m)
    return Anchor(
        map_version=1,
        anchor=name,
        image="tile-1",
        kind="pole",
        signature="",
        landmark=of if tied else "",
        reason="mutually nearest" if tied else "no joint shift stands out",
        sigma_m=0.1,
        residual_x_m=0.0 if tied else None,
        residual_y_m=0.0 if tied else None,
        residual_m=0.0 if tied else None,
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        easting_m=x_m + ORIGIN.easting_m,
        northing_m=y_m + ORIGIN.northing_m,
    )
