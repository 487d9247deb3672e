"""How far an ortho layer lies from what pictures show, along the street that was driven and across it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.truth import TruthPath
from trigpoint.geodesy.projection import WGS84, transform_coordinates

Floats = NDArray[np.float64]

AROUND_M = 30.0  # of a tile's middle: the part of the path that says which way its street runs
STRAIGHT = 0.9  # mean resultant length of the doubled headings there; below, it is a crossing


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfits:
    """Of tiles (n,): metres to the left of the street's direction, and along it."""

    lateral_m: Floats
    longitudinal_m: Floats

    @property
    def lateral_rms_m(self) -> float:
        """Root mean square."""
        return float(np.sqrt((self.lateral_m**2).mean()))

    @property
    def longitudinal_rms_m(self) -> float:
        """Root mean square."""
        return float(np.sqrt((self.longitudinal_m**2).mean()))


def misfits(
    tiles: Mapping[str, Sequence[Mapping[str, Any]]],
    offset_m: Mapping[str, Sequence[float]],
    path: TruthPath,
    *,
    crs: str,
) -> Misfits:
    """Of the tiles that tell, as `trigpoint ortho register --json` has them, by picture: the shift less that picture's
    own offset_m, east and north. Tiles where no single direction was driven are left out."""
    point_m = np.column_stack(transform_coordinates(path.lon_deg, path.lat_deg, source_crs=WGS84, target_crs=crs))
    lateral, longitudinal = list[float](), list[float]()
    for image, items in tiles.items():
        for tile in items:
            near = np.hypot(*(point_m - (tile["easting_m"], tile["northing_m"])).T) < AROUND_M
            doubled = np.exp(2j * path.heading_rad[near]).mean() if near.any() else 0.0
            if tile["refused"] is not None or abs(doubled) < STRAIGHT:
                continue
            ahead = np.exp(0.5j * np.angle(doubled))
            off = complex(tile["shift_m"]["east"], tile["shift_m"]["north"]) - complex(*offset_m[image])
            longitudinal.append((off * ahead.conjugate()).real)
            lateral.append((off * ahead.conjugate()).imag)
    return Misfits(lateral_m=np.array(lateral), longitudinal_m=np.array(longitudinal))
