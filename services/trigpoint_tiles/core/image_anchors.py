"""Anchors an image gives a map by itself: its landmarks where the tiles that tell say the image shows them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint_tiles.core.image_tiles import TileRegistration

Floats = NDArray[np.float64]

LANDMARK_SIGMA_M = 0.1  # 1-sigma per axis of a landmark beside the points around it, of the same map version


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedLandmark:
    """A landmark of a map version, its easting and northing in m in the CRS of the ortho layer made of that version."""

    landmark: str
    kind: str
    easting_m: float
    northing_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageAnchor:
    """Where an image shows a landmark: easting and northing in m, 1-sigma per axis inside the image."""

    landmark: str
    kind: str
    easting_m: float
    northing_m: float
    sigma_m: float


def image_anchors(tiles: Sequence[TileRegistration], landmarks: Sequence[PlacedLandmark]) -> tuple[ImageAnchor, ...]:
    """An anchor for each landmark in a tile that tells: where it is in the map, and the tile's shift.

    All anchors of a tile have the error of its shift in common. Whoever takes them as independent gives them no more
    weight than the shift has: of n, each has n times its variance (of the axis that is known worst), and its own.
    """
    place_m = np.array([[one.easting_m, one.northing_m] for one in landmarks]).reshape(-1, 2)
    found = list[ImageAnchor]()
    for tile in tiles:
        inside = np.flatnonzero(tile.holds(place_m[:, 0], place_m[:, 1]))
        if tile.registration.refused or not len(inside):
            continue
        worst_m2 = float(np.linalg.eigvalsh(tile.registration.covariance_m2)[-1])
        sigma_m = float(np.sqrt(len(inside) * worst_m2 + LANDMARK_SIGMA_M**2))
        found += [_shifted(landmarks[number], tile.registration.shift_m, sigma_m) for number in inside.tolist()]
    return tuple(found)


def _shifted(landmark: PlacedLandmark, shift_m: Floats, sigma_m: float) -> ImageAnchor:
    return ImageAnchor(
        landmark=landmark.landmark,
        kind=landmark.kind,
        easting_m=landmark.easting_m + float(shift_m[0]),
        northing_m=landmark.northing_m + float(shift_m[1]),
        sigma_m=sigma_m,
    )
