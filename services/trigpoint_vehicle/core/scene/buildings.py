"""Buildings, each with a corner landmark as its first corner, none in another, in a street or over a pole."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint_vehicle.core.lidar_settings import FurnitureSettings
from trigpoint_vehicle.core.scene.free_ground import FreeGround
from trigpoint_vehicle.core.streets import Streets

Floats = NDArray[np.float64]

SIDES_TRIED = 5
SAMPLE_M = 0.75  # of a footprint that is looked at for streets and paths
STREET_CLEAR_M, DRIVEN_CLEAR_M = 4.6, 2.2  # from a street's middle and from where a rear axle passes


@dataclass(frozen=True, slots=True, kw_only=True)
class Buildings:
    """Names of the corner landmarks; corner_m (n, 4, 2), the landmark first, round the footprint; height_m (n,)."""

    name: tuple[str, ...]
    corner_m: Floats
    height_m: Floats


def away_from_street(streets: Streets, place_m: Floats) -> Floats:
    """The direction (2,) from the nearest street's middle to a place, of length 1."""
    begin_m, end_m = streets.junction_m[streets.street[:, 0]], streets.junction_m[streets.street[:, 1]]
    span_m = end_m - begin_m
    share = np.clip(((place_m - begin_m) * span_m).sum(axis=1) / (span_m**2).sum(axis=1), 0.0, 1.0)
    off_m = place_m - (begin_m + share[:, None] * span_m)
    away_m = off_m[np.hypot(*off_m.T).argmin()]
    away: Floats = away_m / max(float(np.hypot(*away_m)), 1e-9)
    return away


def footprint_m(corner_m: Floats, along_m: Floats, out_m: Floats) -> Floats:
    """The corners (4, 2) of a rectangle from one corner and its two sides."""
    return np.array([corner_m, corner_m + along_m, corner_m + along_m + out_m, corner_m + out_m])


def is_inside(footprint: Floats, place_m: Floats, margin_m: float) -> NDArray[np.bool_]:
    """Whether places (n, 2) are in a rectangle (4, 2), or no further outside than the margin."""
    along_m, out_m = footprint[1] - footprint[0], footprint[3] - footprint[0]
    inside = np.ones(len(place_m), dtype=np.bool_)
    for side_m in (along_m, out_m):
        length_m = float(np.hypot(*side_m))
        reach_m = (place_m - footprint[0]) @ (side_m / length_m)
        inside &= (reach_m > -margin_m) & (reach_m < length_m + margin_m)
    return inside


def overlap(one: Floats, other: Floats, gap_m: float) -> bool:
    """Whether two rectangles (4, 2) come closer than the gap (separating axes)."""
    for first, second in ((one, other), (other, one)):
        for side_m in (first[1] - first[0], first[3] - first[0]):
            axis = side_m / np.hypot(*side_m)
            mine, theirs = first @ axis, second @ axis
            if mine.min() - gap_m > theirs.max() or theirs.min() - gap_m > mine.max():
                return False
    return True


def _samples_m(footprint: Floats) -> Floats:
    along_m, out_m = footprint[1] - footprint[0], footprint[3] - footprint[0]
    counts = [round(float(np.hypot(*side)) / SAMPLE_M) + 1 for side in (along_m, out_m)]
    share = np.stack(np.meshgrid(*(np.linspace(0.0, 1.0, count) for count in counts)), axis=-1).reshape(-1, 2)
    samples: Floats = footprint[0] + share @ np.array([along_m, out_m])
    return samples


def _fits(footprint: Floats, others: list[Floats], standing_m: Floats, free: FreeGround, gap_m: float) -> bool:
    if is_inside(footprint, standing_m, gap_m).any():
        return False
    if any(overlap(footprint, other, gap_m) for other in others):
        return False
    return bool(free.is_clear(_samples_m(footprint), street_m=STREET_CLEAR_M, driven_m=DRIVEN_CLEAR_M).all())


def _shapes(out: Floats, settings: FurnitureSettings) -> list[tuple[Floats, Floats]]:
    # both ways along the street, every size, the largest first
    along = np.array([-out[1], out[0]])
    sides_m = np.linspace(settings.building_side_max_m, settings.building_side_min_m, SIDES_TRIED)
    shapes = [(way * wide * along, deep * out) for wide in sides_m for deep in sides_m for way in (1.0, -1.0)]
    return sorted(shapes, key=lambda shape: -float(np.hypot(*shape[0]) * np.hypot(*shape[1])))


def raised_buildings(
    names: tuple[str, ...], corner_m: Floats, standing_m: Floats, free: FreeGround, settings: FurnitureSettings
) -> tuple[tuple[str, ...], Floats]:
    """Names (n) and footprints (n, 4, 2) at corner landmarks (c, 2): as large as fits, none where not even the least
    does. `standing_m` (k, 2): what must stay outside."""
    kept, footprints = list[str](), list[Floats]()
    for index, place_m in enumerate(corner_m):
        around_m = np.vstack([standing_m, np.delete(corner_m, index, axis=0)])
        out = away_from_street(free.streets, place_m)
        for along_m, out_m in _shapes(out, settings):
            footprint = footprint_m(place_m, along_m, out_m)
            if _fits(footprint, footprints, around_m, free, settings.building_gap_m):
                kept.append(names[index])
                footprints.append(footprint)
                break
    return tuple(kept), np.array(footprints).reshape(-1, 4, 2)
